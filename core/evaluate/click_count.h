#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/evaluate/evaluation_task.h"
#include "core/evaluate/labeled_view.h"
#include "core/query/segmenter.h"

namespace pepeseg {

// Options of the interactive protocol, which counts the clicks (NoC) that an IoU takes: Sofiiuk,
// Petrov and Konushin, "Reviving iterative training with mask guidance for interactive
// segmentation" (2022), section 4. `min_iou` 0.9 gives NoC@90.
struct ClickOptions {
  double min_iou = 0.9;      // IoU on the clicked view that counts as reached, (0, 1]
  int max_clicks = 20;       // 3 to 256; also the count of an entity that is never reached
  int64_t min_pixels = 100;  // see FindScoredEntities, at least 1
};
// Returns INVALID_ARGUMENT, which names the option, its value and its limits.
absl::Status Validate(const ClickOptions& options);

// A click, and the scores of the mask that it and all clicks before it give.
struct ClickAnswer {
  PointPrompt click;         // pixels of the reference view
  bool on_nothing = false;   // see SimulatedClick
  double reference_iou = 0;  // on the clicked view
  double iou = 0;            // mean over the scored views
};

inline constexpr int kNumEarlyClicks = 3;

struct EntityClicks {
  int id = 0;
  bool reached = false;
  int num_clicks = 0;                // clicks until min_iou; max_clicks if it was never reached
  std::vector<ClickAnswer> answers;  // one for each click, in order
  // Mean IoU over the scored views after 1, 2 and 3 clicks.
  std::array<double, kNumEarlyClicks> iou_after = {};
};

struct ClickScores {
  std::vector<EntityClicks> entities;  // by id
  // Means over the entities.
  double num_clicks = 0;
  double reached = 0;  // share of the entities, [0, 1]
  std::array<double, kNumEarlyClicks> iou_after = {};
};

// Runs SimulateClicks on the reference view of each entity, with at least kNumEarlyClicks clicks
// while a wrong pixel is left, and scores the mask after each click in the other views. Entities
// and references are those of FindScoredEntities. Calls `check_cancelled` before each click and
// returns its error. Returns INVALID_ARGUMENT for the reasons of Validate and FindScoredEntities.
absl::StatusOr<ClickScores> EvaluateClicks(const Segmenter& segmenter,
                                           std::span<const LabeledView> views,
                                           const ClickOptions& options,
                                           absl::FunctionRef<absl::Status()> check_cancelled);

// The same for the entities of a task, [entities], whose prompts must be DeepestClick; ids are 0
// and `min_pixels` is not used. Also calls `check_cancelled` before each entity of a scored view.
absl::StatusOr<std::vector<EntityClicks>> CountClicks(
    const Segmenter& segmenter, const EvaluationTask& task, const ClickOptions& options,
    absl::FunctionRef<absl::Status()> check_cancelled);

}  // namespace pepeseg
