#include "core/prompt/granularity_grid.h"

#include <algorithm>
#include <cmath>

namespace pepeseg {
namespace {

constexpr int kNumScales = 21;
constexpr double kSmallestScale = 0.01;
constexpr float kThresholds[] = {0.5f, 0.55f, 0.6f, 0.65f, 0.7f, 0.75f, 0.8f, 0.85f, 0.9f, 0.95f};

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

std::vector<uint8_t> LevelsOf(std::span<const float> similarity,
                              std::span<const float> thresholds) {
  std::vector<uint8_t> levels(similarity.size());
  for (const float threshold : thresholds) {  // one pass each, which the compiler vectorises
    for (size_t i = 0; i < levels.size(); ++i) levels[i] += similarity[i] > threshold ? 1 : 0;
  }
  return levels;
}

}  // namespace pepeseg
