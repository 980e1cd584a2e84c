#include "core/decompose/visible_weights.h"

#include <algorithm>

#include "core/base/status_macros.h"
#include "core/scene/camera.h"

namespace pepeseg {
namespace {

constexpr int64_t kMaxViews = 32;
constexpr double kMaxGridPixels = 16'384;  // of a view

}  // namespace

absl::StatusOr<std::vector<float>> VisibleWeights(const Model& model, RowsOfPixels rows) {
  const auto num_views = static_cast<int64_t>(model.views.size());
  const auto count = static_cast<size_t>(model.gaussians.count);
  if (num_views == 0) return std::vector<float>(count, 1.0f);
  std::vector<float> weights(count);
  const int64_t num_shown = std::min(num_views, kMaxViews);
  for (int64_t k = 0; k < num_shown; ++k) {
    const ModelView& view = model.views[k * num_views / num_shown];
    ASSIGN_OR_RETURN(const PixelRows shown, rows(view, GridPixels(view.camera, kMaxGridPixels)));
    for (size_t e = 0; e < shown.gaussian.size(); ++e) {
      weights[shown.gaussian[e]] += shown.weight[e];
    }
  }
  return weights;
}

}  // namespace pepeseg
