#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/query/segmenter.h"
#include "core/query/view_places.h"
#include "core/scene/capture.h"
#include "core/scene/mask_set.h"

// Images of a view in the pixels of its photograph: [places.height(), places.width()]. What the
// view does not show is 0.
namespace pepeseg {

// A pixel is in where the mask, smoothed over three pixels of the view (a quadratic B-spline, which
// keeps straight edges in place), is over a half: an enlarged mask has no steps of the view's
// pixels.
BinaryMask MaskInPhotograph(const BinaryMask& mask, const ViewPlaces& places);
// Mask, size, area, box, and the similarity where there is one; the rest stays.
SegmentResult InPhotograph(const SegmentResult& result, const ViewPlaces& places);

// Bilinear.
std::vector<float> ValuesInPhotograph(std::span<const float> values, const ViewPlaces& places);
Image ColorsInPhotograph(const Image& image, const ViewPlaces& places);
// Nearest.
std::vector<float> NearestInPhotograph(std::span<const float> values, const ViewPlaces& places);
std::vector<int32_t> NearestInPhotograph(std::span<const int32_t> ids, const ViewPlaces& places);

}  // namespace pepeseg
