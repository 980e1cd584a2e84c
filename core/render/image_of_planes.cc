#include "core/render/image_of_planes.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace pepeseg {

Image ImageOfPlanes(int width, int height, std::span<const float> planes) {
  Image image = {width, height, 3, {}};
  image.pixels.resize(planes.size());
  const size_t num_pixels = planes.size() / 3;
  for (size_t i = 0; i < planes.size(); ++i) {
    const float value = std::clamp(planes[i % 3 * num_pixels + i / 3], 0.0f, 1.0f);
    image.pixels[i] = static_cast<uint8_t>(std::lround(value * 255));
  }
  return image;
}

}  // namespace pepeseg
