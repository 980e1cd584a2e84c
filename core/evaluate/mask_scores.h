#pragma once

#include <cstdint>
#include <span>
#include <vector>

// Scores of masks against the truth, and how scores are joined over views and entities.

namespace pepeseg {

// Scores of a mask in one view, or their means. Each is in [0, 1].
struct MaskScores {
  double iou = 0;
  double accuracy = 0;      // share of the view's pixels that are right, inside and outside
  double boundary_iou = 0;  // see BoundaryIou
};

// Returns the scores of a mask of width x height pixels. Masks and `ignore` are those of
// segmentation_metrics.h.
MaskScores ScoreMask(std::span<const uint8_t> prediction, std::span<const uint8_t> truth, int width,
                     int height, std::span<const uint8_t> ignore = {});

// Returns the mean, or zeros if there are no scores.
MaskScores MeanOf(std::span<const MaskScores> scores);

}  // namespace pepeseg
