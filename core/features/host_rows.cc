#include "core/features/host_rows.h"

#include <algorithm>
#include <cmath>
#include <span>

namespace pepeseg {

HostRows::HostRows(const CapturedRows& rows)
    : first(static_cast<size_t>(rows.first.size())),
      gaussian(static_cast<size_t>(rows.gaussian.size())),
      weight(static_cast<size_t>(rows.weight.size())) {
  rows.first.Download(std::span<int32_t>(first));
  rows.gaussian.Download(std::span<int32_t>(gaussian));
  rows.weight.Download(std::span<float>(weight));
}

std::vector<int32_t> GridPixels(const View& view, double max_cells) {
  const int width = view.camera.width, height = view.camera.height;
  const int stride =
      std::max(1, static_cast<int>(std::ceil(std::sqrt(double{1} * width * height / max_cells))));
  std::vector<int32_t> pixels;
  for (int y = stride / 2; y < height; y += stride) {
    for (int x = stride / 2; x < width; x += stride) {
      const int32_t pixel = y * width + x;
      if (view.ignore.empty() || view.ignore[pixel] == 0) pixels.push_back(pixel);
    }
  }
  return pixels;
}

}  // namespace pepeseg
