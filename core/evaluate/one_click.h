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

// Options of the one-click protocol (METHOD.md section 5) on the entities of FindScoredEntities.
// The prompt is FirstClick on the reference view; scale and threshold are chosen there and scored
// on the other views.
struct OneClickOptions {
  // Scales (quantiles, [0, 1]) and thresholds (cosines, [-1, 1]) to choose from, ascending.
  std::vector<double> scales = {0.01, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0};
  std::vector<double> thresholds = {0.5, 0.55, 0.6, 0.65, 0.7, 0.75, 0.8, 0.85, 0.9, 0.95};
  // Scales to score without a choice, each for all entities at `fixed_threshold`. Ascending.
  std::vector<double> fixed_scales = {0.01, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0};
  double fixed_threshold = 0.75;
  int64_t min_pixels = 100;  // pixels of an entity that a view must show, at least 1
};
// Returns INVALID_ARGUMENT, which names the option, its value and its limits.
absl::Status Validate(const OneClickOptions& options);

// A scale and a threshold for one entity, and their scores.
struct OneClickChoice {
  double scale = 0;
  double threshold = 0;
  double iou = 0;  // mean over the scored views, as is boundary_iou
  double boundary_iou = 0;
};

struct EntityViewScore {
  std::string view;
  int64_t num_pixels = 0;  // pixels of the entity in the view
  double iou = 0;          // of the chosen scale and threshold, as is boundary_iou
  double boundary_iou = 0;
  std::vector<double> fixed_iou;  // [fixed_scales]
};

struct EntityScore {
  int id = 0;
  PointPrompt click;
  bool missing = false;                // no feature is rendered under the click: all scores are 0
  OneClickChoice chosen;               // has the best IoU on the reference
  OneClickChoice oracle;               // has the best mean IoU on the scored views themselves
  std::vector<double> fixed_iou;       // [fixed_scales], mean over the scored views
  std::vector<EntityViewScore> views;  // by name: the reference, then the scored ones
};

struct OneClickScores {
  std::vector<EntityScore> entities;  // by id
  std::vector<int> left_out;          // ids of entities that fewer than kMinViews views show
  // Means over the entities; scale and threshold stay 0.
  OneClickChoice chosen, oracle;
  std::vector<double> fixed_iou;  // [fixed_scales]
};

// Runs the one-click protocol. Among equally good pairs, the one with the smaller scale is chosen,
// then the one with the lower threshold. Calls `check_cancelled` before each query of a view and
// returns its error. Returns INVALID_ARGUMENT for the reasons of Validate and FindScoredEntities.
absl::StatusOr<OneClickScores> EvaluateOneClick(const Segmenter& segmenter,
                                                std::span<const LabeledView> views,
                                                const OneClickOptions& options,
                                                absl::FunctionRef<absl::Status()> check_cancelled);

}  // namespace pepeseg
