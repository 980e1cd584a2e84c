#include "core/evaluate/mask_scores.h"

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

}  // namespace pepeseg
