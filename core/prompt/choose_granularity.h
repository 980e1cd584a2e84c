#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/query/prompt.h"
#include "core/query/segmenter.h"

// Where a scale and a threshold are chosen, the same question is looked at with many of them, on a
// view that is small enough for that.
namespace pepeseg {

// What is looked at: both ascending. What `granularity` gives stands alone.
struct GranularityGrid {
  std::vector<double> scales;
  std::vector<float> thresholds;
};
GranularityGrid GridOf(const Granularity& granularity);

// The view shrunk by a whole factor to at most kMaxLookPixels: pixel (x, y) of it shows the pixels
// from (factor * x, factor * y) on.
inline constexpr int64_t kMaxLookPixels = 262'144;
struct SmallView {
  ModelView view;
  int factor = 1;
};
SmallView SmallViewOf(const ModelView& view);

// A scale and a threshold that show something stable.
struct StableGranularity {
  double scale = 0, threshold = 0;
  double stability = 0;  // see MaskGrid::Stability
  double support = 0;    // see MaskGrid::Plateau
};
// What a query may mean in a view, see Ladder.
struct GranularityLadder {
  std::vector<StableGranularity> rungs;
  int best = 0;
};
// Of the query, features and signs count. Without rungs: nothing of 16 pixels of the small view is
// there.
absl::StatusOr<GranularityLadder> FindGranularities(const Segmenter& segmenter, const Query& query,
                                                    const ModelView& view,
                                                    const GranularityGrid& grid, int max_count);

}  // namespace pepeseg
