#pragma once

#include <cstdint>
#include <span>
#include <vector>

// Agreement of masks and partitions with ground truth. A mask is [height, width], non-zero inside.
// Pixels with a non-zero `ignore` do not count; an empty `ignore` leaves out none.

namespace pepeseg {

// Returns |P and G| / |P or G| of two masks of equal size, 1 if both are empty.
double Iou(std::span<const uint8_t> prediction, std::span<const uint8_t> truth,
           std::span<const uint8_t> ignore = {});

// Returns the share of pixels in which two masks agree, 1 if no pixel counts.
double PixelAccuracy(std::span<const uint8_t> prediction, std::span<const uint8_t> truth,
                     std::span<const uint8_t> ignore = {});

// Returns, for each threshold, the IoU of the truth and those pixels of `mask` (empty: all pixels)
// whose similarity is over that threshold, from one pass. `thresholds` are cosines, ascending.
std::vector<double> IouByThreshold(std::span<const float> similarity, std::span<const uint8_t> mask,
                                   std::span<const uint8_t> truth, std::span<const uint8_t> ignore,
                                   std::span<const double> thresholds);

// Returns how far inside a mask its boundary reaches on an image of this size, pixels:
// max(1, round(0.02 * diagonal)) (METHOD.md section 5).
int BoundaryWidth(int width, int height);

// Returns the pixels of a mask within `distance` (the larger of |dx| and |dy|) of a pixel outside
// it, 0 or 1 each. Everything beyond the image counts as outside. Equals the mask minus its
// `distance`-fold erosion by a 3x3 square after padding by one pixel of 0. Time does not depend on
// `distance`.
std::vector<uint8_t> MaskBoundary(std::span<const uint8_t> mask, int width, int height,
                                  int distance);

// Returns the IoU of the boundaries of two masks. Boundaries are computed on the whole masks before
// ignored pixels are left out, with the truth in place of the prediction where pixels are ignored,
// so that a prediction there makes no boundary elsewhere.
double BoundaryIou(std::span<const uint8_t> prediction, std::span<const uint8_t> truth, int width,
                   int height, std::span<const uint8_t> ignore = {});

// Scores of a mask in one view, or their means over views or entities. Each is in [0, 1].
struct MaskScores {
  double iou = 0;
  double accuracy = 0;  // see PixelAccuracy
  double boundary_iou = 0;
};

// Returns the scores of a mask of width x height pixels.
MaskScores ScoreMask(std::span<const uint8_t> prediction, std::span<const uint8_t> truth, int width,
                     int height, std::span<const uint8_t> ignore = {});

// Returns the mean, or zeros if there are no scores.
MaskScores MeanOf(std::span<const MaskScores> scores);

// Returns the adjusted Rand index of two partitions of the same elements (Hubert and Arabie 1985):
// 1 for equal partitions, about 0 for independent ones, below 0 for worse than chance. `a` and `b`
// give each element's part by an arbitrary id and have equal length. Returns 1 if both put all
// elements in one part, both have only singletons, or there are fewer than two elements.
double AdjustedRand(std::span<const int32_t> a, std::span<const int32_t> b);

}  // namespace pepeseg
