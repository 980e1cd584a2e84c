#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/evaluate/labeled_view.h"
#include "core/evaluate/scored_entities.h"
#include "core/query/segmenter.h"

namespace pepeseg {

// The one-click protocol (METHOD.md section 5) on the entities of FindScoredEntities. The prompt is
// FirstClick on the reference; scale and threshold are chosen there and scored on the other views.
struct OneClickOptions {
  // What is chosen from: quantile scales in [0, 1], and cosines in [-1, 1]. Ascending.
  std::vector<double> scales = {0.01, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0};
  std::vector<double> thresholds = {0.5, 0.55, 0.6, 0.65, 0.7, 0.75, 0.8, 0.85, 0.9, 0.95};
  // What is asked without a choice: one scale for all entities, at one threshold. Ascending.
  std::vector<double> fixed_scales = {0.01, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0};
  double fixed_threshold = 0.75;
  int64_t min_pixels = 100;  // for a view to show an entity
};
absl::Status Validate(const OneClickOptions& options);

// A scale and a threshold for one entity, and what they score.
struct OneClickChoice {
  double scale = 0;
  double threshold = 0;
  double iou = 0;  // means over the scored views
  double boundary_iou = 0;
};

struct EntityViewScore {
  std::string view;
  int64_t num_pixels = 0;  // that show the entity
  double iou = 0;          // as chosen
  double boundary_iou = 0;
  std::vector<double> fixed_iou;  // [fixed_scales]
};

struct EntityScore {
  int id = 0;
  PointPrompt click;
  bool missing = false;                // there is nothing under the click: everything scores 0
  OneClickChoice chosen;               // the best IoU on the reference
  OneClickChoice oracle;               // the best mean IoU on the scored views themselves
  std::vector<double> fixed_iou;       // [fixed_scales], mean over the scored views
  std::vector<EntityViewScore> views;  // by name: the reference, then the scored ones
};

struct OneClickScores {
  std::vector<EntityScore> entities;  // by id
  std::vector<int> left_out;          // ids of entities that too few views show
  // Means over the entities; scale and threshold stay 0.
  OneClickChoice chosen, oracle;
  std::vector<double> fixed_iou;  // [fixed_scales]
};

// Of several best pairs the one with the smaller scale, then the lower threshold, is taken. `go_on`
// is asked before each look at a view: an error of it ends the evaluation with that error.
// INVALID_ARGUMENT: CheckLabeledViews, no entity counts, more than kMaxEntities do.
absl::StatusOr<OneClickScores> EvaluateOneClick(const Segmenter& segmenter,
                                                std::span<const LabeledView> views,
                                                const OneClickOptions& options,
                                                absl::FunctionRef<absl::Status()> go_on);

}  // namespace pepeseg
