#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/evaluate/labeled_view.h"
#include "core/query/segmenter.h"

namespace pepeseg {

// The interactive protocol, number of clicks (NoC) until an IoU: Sofiiuk, Petrov and Konushin,
// "Reviving iterative training with mask guidance for interactive segmentation" (2022), section 4.
// NoC@90 is `min_iou` 0.9.
struct ClickOptions {
  double min_iou = 0.9;      // on the clicked view, (0, 1]: an entity with it is reached
  int max_clicks = 20;       // 3..256; an entity that is never reached counts as this many
  int64_t min_pixels = 100;  // see FindScoredEntities, at least 1
};
absl::Status Validate(const ClickOptions& options);

// A click and the answer to it and all clicks before it.
struct ClickAnswer {
  PointPrompt click;         // on the reference
  bool on_nothing = false;   // nothing with a feature is rendered there: the click was left out
  double reference_iou = 0;  // on the clicked view
  double iou = 0;            // mean over the scored views
};

inline constexpr int kNumEarlyClicks = 3;

struct EntityClicks {
  int id = 0;
  bool reached = false;
  int num_clicks = 0;                // until min_iou; max_clicks if it was never reached
  std::vector<ClickAnswer> answers;  // to each click that was made
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

// Asks for each entity with clicks on its reference and no scale and no threshold, as a person
// would: ResolvePrompt, which the server's Segment calls, answers them. The first click is
// FirstClick. The next one is the deepest pixel of the largest wrong region, positive in missed
// pixels, negative in spilled ones; as in the authors' code, the largest region is the one that
// reaches deepest, and no pixel is clicked twice. Clicks end at min_iou or max_clicks, but not
// before the third while a wrong pixel is left. Entities and references are those of
// FindScoredEntities. `go_on` is called before each click; its error ends the evaluation.
// INVALID_ARGUMENT: Validate, FindScoredEntities.
absl::StatusOr<ClickScores> EvaluateClicks(const Segmenter& segmenter,
                                           std::span<const LabeledView> views,
                                           const ClickOptions& options,
                                           absl::FunctionRef<absl::Status()> go_on);

}  // namespace pepeseg
