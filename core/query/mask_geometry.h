#pragma once

#include <algorithm>
#include <cstdint>
#include <span>

#include "core/query/prompt.h"
#include "core/query/view_features.h"

// Bounding box and deepest pixel of a mask [height, width] of 0 and 1, overlap of boxes, and
// changes of the mask of a result.

namespace pepeseg {

// Writes x, y, width and height of the smallest box around the pixels of a mask that are 1, or
// zeros if there are none. The mask has `width` columns.
void FindBox(std::span<const uint8_t> mask, int width, int (&box)[4]);

// The edges of a box, pixels.
struct BoxEdges {
  double x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  double Area() const { return std::max(0.0, x1 - x0) * std::max(0.0, y1 - y0); }
};
// Returns the IoU of two boxes. 0: they do not overlap.
double IouOf(const BoxEdges& a, const BoxEdges& b);
// Returns the part of a box that is in an image.
BoxEdges EdgesIn(const BoxPrompt& box, int width, int height);

struct PixelIndex {
  int x = 0, y = 0;
};

struct DeepPixel {
  PixelIndex pixel;
  int64_t squared_depth = 0;  // squared distance to the nearest pixel outside the mask, pixels^2
};

// Returns the pixel of a mask with the largest Euclidean distance to the nearest pixel outside it,
// the first one in reading order among equals. Everything beyond the image is outside. Exact, in
// time linear in the area of the mask's bounding box. Depth 0: the mask is empty.
DeepPixel FindDeepest(std::span<const uint8_t> mask, int width, int height);
// Returns only the pixel of FindDeepest. The mask must not be empty.
PixelIndex DeepestPixel(std::span<const uint8_t> mask, int width, int height);

// Sets the mask of a result, and the area, box and score that follow from it. The result must have
// the similarity of each pixel.
void SetMask(BinaryMask mask, SegmentResult& result);

// How far the answer to a box may reach beyond it, pixels of the view. Boxes are drawn by hand.
inline constexpr double kBoxSlack = 5;

// Cuts the mask of the answer to a box, in the view of the box, to the box and kBoxSlack around it.
// Returns the IoU of the box, as far as it lies in the view, and the mask's bounding box before the
// cut: low where the model shows nothing that fills the box. The result must have the similarity of
// each pixel.
double CutToBox(const BoxPrompt& box, SegmentResult& result);

}  // namespace pepeseg
