#include "core/evaluate/reference_choice.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace pepeseg {
namespace {

constexpr double kIouSpread = 0.01;  // fall of the IoU by which a cell's weight falls to 1 / e
constexpr double kMostLoss = 3 * kIouSpread;
constexpr double kThresholdDrop = 0.05;  // cosine
// One step of the usual grid; distances between cells are measured in them.
constexpr double kScaleStep = 0.1, kThresholdStep = 0.05;

GridCell CellAt(size_t index, size_t num_thresholds) {
  return {static_cast<int>(index / num_thresholds), static_cast<int>(index % num_thresholds)};
}

}  // namespace

GridCell BestCell(std::span<const double> ious, size_t num_thresholds) {
  const auto best = std::max_element(ious.begin(), ious.end());
  return CellAt(static_cast<size_t>(best - ious.begin()), num_thresholds);
}

GridCell ChooseFromReference(std::span<const double> ious, std::span<const double> scales,
                             std::span<const double> thresholds) {
  const double best_iou = *std::max_element(ious.begin(), ious.end());
  double weights = 0, mean_scale = 0, mean_threshold = 0;
  for (size_t i = 0; i < ious.size(); ++i) {
    const double weight = std::exp((ious[i] - best_iou) / kIouSpread);
    weights += weight;
    mean_scale += weight * scales[i / thresholds.size()];
    mean_threshold += weight * thresholds[i % thresholds.size()];
  }
  mean_scale /= weights;
  mean_threshold = mean_threshold / weights - kThresholdDrop;

  GridCell chosen;
  double least = std::numeric_limits<double>::infinity();
  for (size_t i = 0; i < ious.size(); ++i) {
    if (ious[i] < best_iou - kMostLoss) continue;
    const GridCell cell = CellAt(i, thresholds.size());
    const double distance =
        std::hypot((scales[cell.scale] - mean_scale) / kScaleStep,
                   (thresholds[cell.threshold] - mean_threshold) / kThresholdStep);
    if (distance >= least) continue;
    least = distance;
    chosen = cell;
  }
  return chosen;
}

}  // namespace pepeseg
