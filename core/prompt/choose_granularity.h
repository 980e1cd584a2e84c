#pragma once

#include <cstdint>
#include <vector>

#include "core/query/prompt.h"
#include "core/query/segmenter.h"

// Where a scale and a threshold are chosen, masks at many of them are compared, on a view that is
// small enough for that.
namespace pepeseg {

// The scales and thresholds to compare, both ascending. One that `granularity` gives is the only
// one.
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

}  // namespace pepeseg
