#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/query/prompt.h"
#include "core/query/segmenter.h"

// Scale and threshold of a prompt are chosen by comparing masks at many of them, on a view that is
// small enough for that.

namespace pepeseg {

// The scales (quantiles) and thresholds (cosines) to compare, both ascending.
struct GranularityGrid {
  std::vector<double> scales;
  std::vector<float> thresholds;
};
// Returns the grid for `granularity`: a scale or threshold that it gives is the only one.
GranularityGrid GridOf(const Granularity& granularity);

// Maximum size of a view on which masks are compared, pixels.
inline constexpr int64_t kMaxLookPixels = 262'144;
// A view shrunk by a whole factor. Its pixel (x, y) covers the `factor` x `factor` pixels of the
// original view that start at (factor * x, factor * y).
struct SmallView {
  ModelView view;
  int factor = 1;
};
// Returns the view shrunk by the smallest whole factor that leaves at most kMaxLookPixels.
SmallView SmallViewOf(const ModelView& view);

// Returns, for each pixel, how many of the thresholds its similarity exceeds. At most 255
// thresholds.
std::vector<uint8_t> LevelsOf(std::span<const float> similarity, std::span<const float> thresholds);

}  // namespace pepeseg
