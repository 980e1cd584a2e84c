#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace pepeseg {

// How far inside a mask its boundary reaches on an image of this size, pixels:
// max(1, round(0.02 * diagonal)) (METHOD.md section 5).
int BoundaryWidth(int width, int height);

// The mask [height, width] without what is left of it, padded by one pixel of 0, after `distance`
// erosions by 3x3: its pixels within that distance (the larger of |dx| and |dy|) of one that is not
// in the mask, as none beyond the image is. 0 or 1 a pixel. Time does not depend on `distance`.
std::vector<uint8_t> MaskBoundary(std::span<const uint8_t> mask, int width, int height,
                                  int distance);

// Iou of the boundaries of two masks [height, width]. Boundaries are those of the whole masks;
// pixels with a non-zero `ignore` (empty: none) do not count.
double BoundaryIou(std::span<const uint8_t> prediction, std::span<const uint8_t> truth, int width,
                   int height, std::span<const uint8_t> ignore = {});

}  // namespace pepeseg
