#include "core/evaluate/mask_scores.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/evaluate/segmentation_metrics.h"

namespace pepeseg {

MaskScores ScoreMask(std::span<const uint8_t> prediction, std::span<const uint8_t> truth, int width,
                     int height, std::span<const uint8_t> ignore) {
  return {Iou(prediction, truth, ignore), PixelAccuracy(prediction, truth, ignore),
          BoundaryIou(prediction, truth, width, height, ignore)};
}

MaskScores MeanOf(std::span<const MaskScores> scores) {
  MaskScores mean;
  if (scores.empty()) return mean;
  for (const MaskScores& score : scores) {
    mean.iou += score.iou;
    mean.accuracy += score.accuracy;
    mean.boundary_iou += score.boundary_iou;
  }
  const auto count = static_cast<double>(scores.size());
  return {mean.iou / count, mean.accuracy / count, mean.boundary_iou / count};
}

Spread SpreadOf(std::span<const double> values) {
  Spread spread;
  if (values.empty()) return spread;
  spread.count = static_cast<int>(values.size());
  spread.mean = std::accumulate(values.begin(), values.end(), 0.0) / spread.count;
  const auto [min, max] = std::minmax_element(values.begin(), values.end());
  spread.min = *min;
  spread.max = *max;
  if (spread.count < 2) return spread;
  double squares = 0;
  for (const double value : values) squares += (value - spread.mean) * (value - spread.mean);
  spread.deviation = std::sqrt(squares / (spread.count - 1));
  return spread;
}

}  // namespace pepeseg
