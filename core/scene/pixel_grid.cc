#include "core/scene/pixel_grid.h"

#include <algorithm>
#include <cmath>

namespace pepeseg {

std::vector<int32_t> GridPixels(const Camera& camera, double max_cells) {
  const double num_pixels = double{1} * camera.width * camera.height;
  const int stride = std::max(1, static_cast<int>(std::ceil(std::sqrt(num_pixels / max_cells))));
  std::vector<int32_t> pixels;
  for (int y = stride / 2; y < camera.height; y += stride) {
    for (int x = stride / 2; x < camera.width; x += stride) pixels.push_back(y * camera.width + x);
  }
  return pixels;
}

}  // namespace pepeseg
