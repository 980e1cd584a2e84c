#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/prompt/choose_granularity.h"
#include "core/query/deepest_pixel.h"
#include "core/query/prompt.h"
#include "core/query/segmenter.h"

// Scale and threshold of a prompt of points (METHOD.md section 4, "Points").

namespace pepeseg {

// A scale and a threshold that show something stable.
struct StableGranularity {
  double scale = 0, threshold = 0;
  double stability = 0;  // see MaskGrid::Stability
  double support = 0;    // see MaskGrid::Plateau
};
// What points may mean in their view, see Ladder.
struct GranularityLadder {
  std::vector<StableGranularity> rungs;
  int best = 0;
};

// Points of a view, and the features under them. Once the first positive point is answered, the
// others are corrections, in their order.
struct ClickedFeatures {
  ModelView view;
  std::vector<PointPrompt> points;
  Query query;  // features and signs of the points; scale and threshold do not count
};
// INVALID_ARGUMENT: Segmenter::PointFeatures.
absl::StatusOr<ClickedFeatures> FindClickedFeatures(const Segmenter& segmenter,
                                                    const ModelView& view,
                                                    std::span<const PointPrompt> points);

// Returns what the points may mean, at most `max_count` rungs. For one point the best rung is the
// mask with the most support. With each further point all masks are compared again, and the best
// one is that which the point asks for, see ClickPlausibility. Without rungs: no mask has 16 pixels
// of the small view at any scale.
absl::StatusOr<GranularityLadder> FindGranularities(const Segmenter& segmenter,
                                                    const ClickedFeatures& clicks,
                                                    const GranularityGrid& grid, int max_count);

// Returns how plausible it is, [0, 1], that somebody who sees the mask `before` and clicks on
// `pixel` wants the mask `after`, both [height, width] of 0 and 1. A person clicks into the middle
// of what is wrong and means to keep the rest. So this is the depth of the pixel in what changes
// (added by a positive click, removed by a negative one), relative to the deepest pixel there,
// times the share of the smaller mask that the larger one holds. Where `before` has the click's
// answer already, it is the IoU of the two masks. 0 if `after` is empty or the pixel does not
// change.
struct Click {
  PixelIndex pixel;
  bool positive = true;
};
double ClickPlausibility(const Click& click, std::span<const uint8_t> before,
                         std::span<const uint8_t> after, int width);

}  // namespace pepeseg
