#include "core/select/prompted_pixels.h"

#include <cmath>

namespace pepeseg {
namespace {

constexpr double kPointRadius = 2;  // pixels: the one clicked may show a gap between Gaussians

struct Pointing {
  double x, y;  // a pixel's centre
  int32_t pixel;

  bool operator()(const std::vector<PointPrompt>& points) const {
    for (const PointPrompt& point : points) {
      if (point.positive && std::hypot(point.x - x, point.y - y) <= kPointRadius) return true;
    }
    return false;
  }
  bool operator()(const BoxPrompt& box) const {
    return x >= box.x && x < box.x + box.width && y >= box.y && y < box.y + box.height;
  }
  bool operator()(const BinaryMask& mask) const { return mask.pixels[pixel] != 0; }
};

}  // namespace

std::vector<int32_t> PromptedPixels(const Prompt& prompt, size_t max_count) {
  const int width = prompt.view.camera.width, height = prompt.view.camera.height;
  std::vector<int32_t> pixels;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const Pointing points_at = {x + 0.5, y + 0.5, y * width + x};
      if (std::visit(points_at, prompt.what)) pixels.push_back(points_at.pixel);
    }
  }
  if (pixels.size() <= max_count) return pixels;
  std::vector<int32_t> thinned;
  thinned.reserve(max_count);
  for (size_t i = 0; i < max_count; ++i) {
    thinned.push_back(pixels[(2 * i + 1) * pixels.size() / (2 * max_count)]);
  }
  return thinned;
}

}  // namespace pepeseg
