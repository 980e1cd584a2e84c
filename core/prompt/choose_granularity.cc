#include "core/prompt/choose_granularity.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/base/status_macros.h"
#include "core/prompt/ladder.h"
#include "core/query/mask_grid.h"
#include "kernels/ops/render.h"

namespace pepeseg {
namespace {

constexpr int kNumScales = 21;
constexpr double kSmallestScale = 0.01;
constexpr float kThresholds[] = {0.5f, 0.55f, 0.6f, 0.65f, 0.7f, 0.75f, 0.8f, 0.85f, 0.9f, 0.95f};
constexpr int64_t kMinArea = 16;  // pixels of the small view

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

absl::StatusOr<GranularityLadder> FindGranularities(const Segmenter& segmenter, const Query& query,
                                                    const ModelView& view,
                                                    const GranularityGrid& grid, int max_count) {
  ASSIGN_OR_RETURN(LevelCounts counts, segmenter.CountLevels(query, grid.scales, grid.thresholds,
                                                             SmallViewOf(view).view));
  const Ladder ladder = FindLadder(MaskGrid(std::move(counts)), kMinArea, max_count);
  GranularityLadder found = {{}, ladder.best};
  for (const MaskGrid::Plateau& rung : ladder.rungs) {
    found.rungs.push_back({grid.scales[rung.cell.scale],
                           double{grid.thresholds[rung.cell.threshold]}, rung.stability,
                           rung.support});
  }
  return found;
}

}  // namespace pepeseg
