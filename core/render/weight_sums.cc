#include "core/render/weight_sums.h"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace pepeseg {
namespace {

Viewpoint Shrunk(Viewpoint view) {
  Camera& camera = view.camera;
  const int64_t num_pixels = int64_t{camera.width} * camera.height;
  if (num_pixels <= kMaxWeightPixels) return view;
  const double scale =
      std::sqrt(static_cast<double>(kMaxWeightPixels) / static_cast<double>(num_pixels));
  const auto shrunk = [&](int side, int64_t most) {
    return static_cast<int>(std::clamp(static_cast<int64_t>(side * scale), int64_t{1}, most));
  };
  const int width = shrunk(camera.width, kMaxWeightPixels);
  const int height = shrunk(camera.height, kMaxWeightPixels / width);
  camera = Resized(camera, width, height);
  return view;
}

// Returns the pixel of a side of `to` pixels at the centre of pixel `at` of a side of `from`.
int32_t AtCentre(int32_t at, int from, int to) {
  return static_cast<int32_t>((2 * int64_t{at} + 1) * to / (2 * int64_t{from}));
}

}  // namespace

WeightView::WeightView(const Viewpoint& view)
    : full_width_(view.camera.width), full_height_(view.camera.height), shrunk_(Shrunk(view)) {}

std::vector<int32_t> WeightView::FullPixels() const {
  const Camera& shrunk = shrunk_.camera;
  std::vector<int32_t> columns(static_cast<size_t>(shrunk.width)), pixels;
  for (int x = 0; x < shrunk.width; ++x) columns[x] = AtCentre(x, shrunk.width, full_width_);
  pixels.reserve(static_cast<size_t>(num_pixels()));
  for (int y = 0; y < shrunk.height; ++y) {
    const int32_t first = AtCentre(y, shrunk.height, full_height_) * full_width_;
    for (const int32_t column : columns) pixels.push_back(first + column);
  }
  return pixels;
}

int32_t WeightView::PixelAt(int32_t full_pixel) const {
  const Camera& shrunk = shrunk_.camera;
  return AtCentre(full_pixel / full_width_, full_height_, shrunk.height) * shrunk.width +
         AtCentre(full_pixel % full_width_, full_width_, shrunk.width);
}

void WeightSums::Measure(const WeightView& view, std::span<const std::vector<uint8_t>> masks) {
  const auto num_pixels = static_cast<size_t>(view.num_pixels());
  host_grad_.assign(3 * num_pixels, 0.0f);
  for (size_t k = 0; k < masks.size(); ++k) {
    assert(masks[k].size() == num_pixels);
    std::ranges::copy(masks[k], host_grad_.begin() + static_cast<int64_t>(k * num_pixels));
  }
  color_grad_.Reserve(scene_.backend(), static_cast<int64_t>(host_grad_.size()));
  color_grad_.Upload(host_grad_);
  scene_.RenderBackward(view.viewpoint(), color_grad_.span());
}

void WeightSums::AddTo(DeviceSpan<float> sums, int num_masks) {
  scene_.AddWeights(sums, num_masks);
}

}  // namespace pepeseg
