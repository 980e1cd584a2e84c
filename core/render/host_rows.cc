#include "core/render/host_rows.h"

#include <span>

#include "core/scene/camera.h"

namespace pepeseg {

HostRows::HostRows(const CapturedRows& rows)
    : first(static_cast<size_t>(rows.first.size())),
      gaussian(static_cast<size_t>(rows.gaussian.size())),
      weight(static_cast<size_t>(rows.weight.size())) {
  rows.first.Download(std::span<int32_t>(first));
  rows.gaussian.Download(std::span<int32_t>(gaussian));
  rows.weight.Download(std::span<float>(weight));
}

std::vector<int32_t> KnownGridPixels(const View& view, double max_cells) {
  std::vector<int32_t> pixels = GridPixels(view.camera, max_cells);
  if (!view.ignore.empty()) std::erase_if(pixels, [&](int32_t p) { return view.ignore[p] != 0; });
  return pixels;
}

}  // namespace pepeseg
