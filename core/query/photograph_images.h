#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/query/segmenter.h"
#include "core/query/view_places.h"
#include "core/scene/capture.h"
#include "core/scene/mask_set.h"

// Resample images of a view to the pixels of its photograph, [places.height(), places.width()].
// Pixels that the view does not show are 0.
namespace pepeseg {

// Returns the mask in the photograph. A pixel is inside if the mask, smoothed over three pixels of
// the view by a quadratic B-spline (which keeps straight edges in place), exceeds 0.5 there. An
// enlarged mask thus does not show the steps of the view's pixels.
BinaryMask MaskInPhotograph(const BinaryMask& mask, const ViewPlaces& places);
// Returns the result with mask, size, area, box and similarity (if there is one) in the photograph.
// The score is 0 if the mask becomes empty; the other fields stay.
SegmentResult InPhotograph(const SegmentResult& result, const ViewPlaces& places);

// Resample bilinearly.
std::vector<float> ValuesInPhotograph(std::span<const float> values, const ViewPlaces& places);
Image ColorsInPhotograph(const Image& image, const ViewPlaces& places);
// Resample to the nearest value.
std::vector<float> NearestInPhotograph(std::span<const float> values, const ViewPlaces& places);
std::vector<int32_t> NearestInPhotograph(std::span<const int32_t> ids, const ViewPlaces& places);

}  // namespace pepeseg
