#include "core/features/feature_confidence.h"

#include <algorithm>
#include <span>

#include "core/features/mask_scales.h"
#include "core/render/renderer.h"

namespace pepeseg {
namespace {

constexpr size_t kMaxViews = 64;      // views that are looked at
constexpr double kMaxCells = 32'768;  // pixels that are looked at in a view, on a grid
// Sum of a Gaussian's blending weights over these pixels above which the view shows it.
constexpr float kMinWeight = 0.01f;
constexpr float kMinViewShare = 1.0f / 6;  // of the views that are looked at: see FeatureConfidence
constexpr float kOfUnseen = 0.005f;        // smallest confidence

// Returns up to kMaxViews of the views that stage two learns from, spread evenly.
std::vector<const View*> SomeTrained(const Capture& capture) {
  std::vector<const View*> all;
  for (const View& view : capture.views) {
    if (IsTrained(view)) all.push_back(&view);
  }
  const size_t num = std::min(kMaxViews, all.size());
  std::vector<const View*> some;
  for (size_t k = 0; k < num; ++k) some.push_back(all[k * all.size() / num]);
  return some;
}

}  // namespace

std::vector<float> FeatureConfidence(const Capture& capture, Renderer& scene,
                                     int min_confident_views) {
  const auto count = static_cast<size_t>(scene.num_gaussians());
  const std::vector<const View*> views = SomeTrained(capture);
  const auto num_looked_at = static_cast<float>(views.size());
  const float num_required =
      std::max({1.0f, std::min(static_cast<float>(min_confident_views), num_looked_at),
                kMinViewShare * num_looked_at});
  std::vector<int> num_views(count);
  std::vector<float> weight(count);
  for (const View* view : views) {
    std::ranges::fill(weight, 0.0f);
    const PixelRows rows = ToHost(scene.Rows(*view, KnownGridPixels(*view, kMaxCells)));
    for (size_t e = 0; e < rows.gaussian.size(); ++e) weight[rows.gaussian[e]] += rows.weight[e];
    for (size_t i = 0; i < count; ++i) num_views[i] += weight[i] > kMinWeight ? 1 : 0;
  }
  std::vector<float> confidence(count);
  std::ranges::transform(num_views, confidence.begin(), [&](int num) {
    const float share = static_cast<float>(num) / num_required;
    return std::clamp(share * share, kOfUnseen, 1.0f);
  });
  return confidence;
}

}  // namespace pepeseg
