#pragma once

#include <array>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/evaluate/evaluation_task.h"
#include "core/query/image_segmenter.h"
#include "core/query/segmenter.h"

// Protocol "clicks": counts the clicks (NoC) that an IoU takes, with nothing chosen by hand.
// Sofiiuk, Petrov and Konushin, "Reviving iterative training with mask guidance for interactive
// segmentation" (2022), section 4.

namespace pepeseg {

inline constexpr int kNumEarlyClicks = 3;

struct ClickOptions {
  double min_iou = 0.9;  // IoU on the clicked view that counts as reached, (0, 1]; 0.9 is NoC@90
  // Clicks on an entity at most, kNumEarlyClicks to 256; also the count of an entity that is never
  // reached.
  int max_clicks = 20;
};
// Returns INVALID_ARGUMENT, which names the option, its value and its limits.
absl::Status Validate(const ClickOptions& options);

// A click, and the scores of the mask that it and all clicks before it give.
struct ClickAnswer {
  PointPrompt click;         // pixels of the reference view
  bool on_nothing = false;   // no feature is rendered there: the query leaves the click out
  double reference_iou = 0;  // on the clicked view
  double iou = 0;            // mean over the scored views
};

struct EntityClicks {
  bool reached = false;
  int num_clicks = 0;                // clicks until min_iou; max_clicks if it was never reached
  std::vector<ClickAnswer> answers;  // one for each click, in order
  // Mean IoU over the scored views after 1, 2 and 3 clicks.
  std::array<double, kNumEarlyClicks> iou_after = {};
};

// Simulates a person who clicks on each entity in its reference view and gives no scale and no
// threshold. PromptedThing answers, as in the server, with the help of `images` if these are given.
// The first click is on the deepest pixel of the entity. Each further click is on the deepest pixel
// of the largest wrong region: positive in missed pixels, negative in pixels outside the entity. As
// in the authors' code, the largest region is the one that reaches deepest, and no pixel is clicked
// twice. The clicks end at min_iou, but not before kNumEarlyClicks; at max_clicks; or when no wrong
// pixel is left. The mask after each click is scored in the scored views.
//
// Returns [entities of the task], whose prompts must be DeepestClick. Calls `check_cancelled`
// before each click and before each entity of a scored view and returns its error. Returns
// INVALID_ARGUMENT for the reasons of Validate, and for another prompt, with the entity's name.
// segment: of each mask. images: may be null.
absl::StatusOr<std::vector<EntityClicks>> CountClicks(
    const Segmenter& segmenter, const EvaluationTask& task, const ClickOptions& options,
    const SegmentOptions& segment, ImageSegmenter* images,
    absl::FunctionRef<absl::Status()> check_cancelled);

}  // namespace pepeseg
