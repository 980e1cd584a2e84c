#pragma once

#include <cstdint>
#include <span>

namespace pepeseg {

struct PixelIndex {
  int x = 0, y = 0;
};

struct DeepPixel {
  PixelIndex pixel;
  int64_t squared_depth = 0;  // squared distance to the nearest pixel that is not in the mask
};

// The pixel of a mask [height, width] with the largest Euclidean distance to the nearest one that
// is not in it, as none beyond the image is; the first in reading order of several. Exact, in time
// linear in the mask's bounding box. An empty mask: depth 0.
DeepPixel FindDeepest(std::span<const uint8_t> mask, int width, int height);
// Its pixel. The mask must not be empty.
PixelIndex DeepestPixel(std::span<const uint8_t> mask, int width, int height);

}  // namespace pepeseg
