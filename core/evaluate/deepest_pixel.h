#pragma once

#include <cstdint>
#include <span>

namespace pepeseg {

struct PixelIndex {
  int x = 0, y = 0;
};

// The pixel of a mask [height, width] with the largest Euclidean distance to the nearest one that
// is not in it, as none beyond the image is; the first in reading order of several. Exact, in time
// linear in the mask's bounding box. The mask must not be empty.
PixelIndex DeepestPixel(std::span<const uint8_t> mask, int width, int height);

}  // namespace pepeseg
