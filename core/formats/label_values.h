#pragma once

#include <cstdint>
#include <optional>

#include "core/formats/decode_image.h"

namespace pepeseg {

// Returns the value above which a pixel is inside, if the labels are those of one mask with soft
// borders: two values nearly everywhere, and others only between them, as drawing tools, blurs,
// resizing and JPEG leave them. Returns nothing for labels of several things, for masks with sharp
// borders, and for labels that are colours.
std::optional<uint32_t> SoftMaskThreshold(const LabelImage& image);

// Returns whether image.void_label marks void pixels, as along the borders of things in the label
// images of PASCAL VOC: hardly anywhere more than 7 pixels wide, mostly within 5 pixels of another
// label that is not 0, and, where labels are grey values, the largest one and not the last of a
// series.
bool HasVoidBorders(const LabelImage& image);

// Returns the labels at another size by the nearest pixel.
LabelImage ResizedLabels(const LabelImage& image, int width, int height);

}  // namespace pepeseg
