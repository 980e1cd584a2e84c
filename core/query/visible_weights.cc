#include "core/query/visible_weights.h"

#include <algorithm>
#include <cmath>

#include "core/status_macros.h"

namespace pepeseg {
namespace {

constexpr int64_t kMaxViews = 32;
constexpr double kMaxGridPixels = 16'384;  // of a view

std::vector<int32_t> GridPixels(const Camera& camera) {
  const double num_pixels = double{1} * camera.width * camera.height;
  const int stride =
      std::max(1, static_cast<int>(std::ceil(std::sqrt(num_pixels / kMaxGridPixels))));
  std::vector<int32_t> pixels;
  pixels.reserve(static_cast<size_t>(kMaxGridPixels));
  for (int y = stride / 2; y < camera.height; y += stride) {
    for (int x = stride / 2; x < camera.width; x += stride) pixels.push_back(y * camera.width + x);
  }
  return pixels;
}

}  // namespace

absl::StatusOr<std::vector<float>> VisibleWeights(const Model& model, RowsOfPixels rows) {
  const auto num_views = static_cast<int64_t>(model.views.size());
  const auto count = static_cast<size_t>(model.gaussians.count);
  if (num_views == 0) return std::vector<float>(count, 1.0f);
  std::vector<float> weights(count);
  const int64_t num_shown = std::min(num_views, kMaxViews);
  for (int64_t k = 0; k < num_shown; ++k) {
    const ModelView& view = model.views[k * num_views / num_shown];
    ASSIGN_OR_RETURN(const PixelRows shown, rows(view, GridPixels(view.camera)));
    for (size_t e = 0; e < shown.gaussian.size(); ++e) {
      weights[shown.gaussian[e]] += shown.weight[e];
    }
  }
  return weights;
}

}  // namespace pepeseg
