#include "core/query/choose_granularity.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/query/mask_grid.h"
#include "core/status_macros.h"
#include "kernels/ops.h"

namespace pepeseg {
namespace {

constexpr int kNumScales = 21;
constexpr double kSmallestScale = 0.01;
constexpr float kThresholds[] = {0.5f, 0.55f, 0.6f, 0.65f, 0.7f, 0.75f, 0.8f, 0.85f, 0.9f, 0.95f};
constexpr int64_t kMinArea = 16;  // pixels of the small view

// The best similarity of each pixel to the features of one kind; never, where there is none.
std::vector<float> BestOf(std::span<const uint8_t> kinds, uint8_t kind,
                          std::span<const float> similarities) {
  const size_t num_pixels = similarities.size() / kinds.size();
  std::vector<float> best(num_pixels, -std::numeric_limits<float>::infinity());
  for (size_t i = 0; i < kinds.size(); ++i) {
    if (kinds[i] != kind) continue;
    const std::span<const float> of_feature = similarities.subspan(i * num_pixels, num_pixels);
    for (size_t p = 0; p < num_pixels; ++p) best[p] = std::max(best[p], of_feature[p]);
  }
  return best;
}

}  // namespace

GranularityGrid GridOf(const Granularity& granularity) {
  GranularityGrid grid;
  if (granularity.scale) {
    grid.scales = {*granularity.scale};
  } else {
    for (int i = 0; i < kNumScales; ++i) {
      grid.scales.push_back(std::max(kSmallestScale, static_cast<double>(i) / (kNumScales - 1)));
    }
  }
  if (granularity.threshold) {
    grid.thresholds = {static_cast<float>(*granularity.threshold)};
  } else {
    grid.thresholds.assign(std::begin(kThresholds), std::end(kThresholds));
  }
  return grid;
}

SmallView SmallViewOf(const ModelView& view) {
  SmallView small = {view, 1};
  Camera& camera = small.view.camera;
  const double num_pixels = static_cast<double>(camera.width) * camera.height;
  small.factor = std::max(
      1, static_cast<int>(std::ceil(std::sqrt(num_pixels / static_cast<double>(kMaxLookPixels)))));
  camera.width = std::max(1, camera.width / small.factor);
  camera.height = std::max(1, camera.height / small.factor);
  for (double* value : {&camera.fx, &camera.fy, &camera.cx, &camera.cy}) *value /= small.factor;
  return small;
}

absl::StatusOr<std::vector<StableGranularity>> FindStable(const Segmenter& segmenter,
                                                          const Query& query, const ModelView& view,
                                                          const GranularityGrid& grid,
                                                          int max_count) {
  const SmallView small = SmallViewOf(view);
  MaskGrid masks(grid.thresholds);
  for (const double scale : grid.scales) {
    ASSIGN_OR_RETURN(const std::vector<float> similarities,
                     segmenter.Similarity(query.features, scale, small.view));
    masks.AddScale(BestOf(query.positive, 1, similarities),
                   BestOf(query.positive, 0, similarities));
  }
  std::vector<StableGranularity> found;
  for (const MaskGrid::Plateau& plateau : masks.FindPlateaus(kMinArea, max_count)) {
    found.push_back({grid.scales[plateau.cell.scale],
                     double{grid.thresholds[plateau.cell.threshold]}, plateau.stability,
                     plateau.support});
  }
  return found;
}

}  // namespace pepeseg
