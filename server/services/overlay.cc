#include "server/services/overlay.h"

#include <cassert>
#include <cmath>
#include <cstddef>

namespace pepeseg {
namespace {

constexpr uint8_t kColor[3] = {255, 120, 0};
constexpr double kTint = 0.45;

bool IsBorder(const BinaryMask& mask, const Image& image, int x, int y) {
  const auto is_out = [&](int at_x, int at_y) {
    return at_x < 0 || at_x >= image.width || at_y < 0 || at_y >= image.height ||
           mask.pixels[static_cast<size_t>(at_y) * image.width + at_x] == 0;
  };
  return is_out(x - 1, y) || is_out(x + 1, y) || is_out(x, y - 1) || is_out(x, y + 1);
}

}  // namespace

void DrawOverlay(const BinaryMask& mask, Image& image) {
  assert(image.channels == 3 && mask.pixels.size() * 3 == image.pixels.size());
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const size_t pixel = static_cast<size_t>(y) * image.width + x;
      if (mask.pixels[pixel] == 0) continue;
      const double share = IsBorder(mask, image, x, y) ? 1 : kTint;
      for (int k = 0; k < 3; ++k) {
        uint8_t& value = image.pixels[3 * pixel + k];
        value = static_cast<uint8_t>(std::lround((1 - share) * value + share * kColor[k]));
      }
    }
  }
}

}  // namespace pepeseg
