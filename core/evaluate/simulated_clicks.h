#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/statusor.h"
#include "core/query/prompt.h"
#include "core/query/segmenter.h"

namespace pepeseg {

// What a simulated person clicks on. The spans must outlive the simulation.
struct ClickTarget {
  const ModelView& view;
  std::span<const uint8_t> truth;  // [height, width] of 0 and 1; 0 where ignored
  std::span<const uint8_t>
      ignore;  // [height, width], non-zero: neither clicked nor scored; or empty
};

// When the person stops.
struct ClickLimits {
  double min_iou = 0.9;      // IoU that counts as reached, (0, 1]
  int max_clicks = 10;       // at least 1
  int num_early_clicks = 0;  // clicks made even after min_iou, while a wrong pixel is left
};

// A click, and the query of it and all clicks before it.
struct SimulatedClick {
  PointPrompt click;        // pixels of the view
  bool on_nothing = false;  // no feature is rendered there: the query leaves the click out
  double iou = 0;           // on the clicked view
  Query query;              // no features: all clicks so far are on nothing
};

// Simulates a person who clicks on one entity and gives no scale and no threshold: ResolvePrompt,
// which also serves the server's Segment, chooses both. The first click is on the deepest pixel of
// the truth. Each further click is on the deepest pixel of the largest wrong region: positive in
// missed pixels, negative in pixels outside the entity. As in the authors' code, the largest region
// is the one that reaches deepest, and no pixel is clicked twice. Returns the clicks in order; they
// end at the limits, or when no wrong pixel is left. Calls `check_cancelled` before each click and
// returns its error.
absl::StatusOr<std::vector<SimulatedClick>> SimulateClicks(
    const Segmenter& segmenter, const ClickTarget& target, const ClickLimits& limits,
    absl::FunctionRef<absl::Status()> check_cancelled);

// Returns the number of clicks until min_iou, or 0 if it was never reached.
int ClicksUntil(std::span<const SimulatedClick> clicks, double min_iou);

}  // namespace pepeseg
