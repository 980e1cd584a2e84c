#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/evaluate/click_count.h"
#include "core/evaluate/entity_queries.h"
#include "core/evaluate/evaluation_task.h"
#include "core/evaluate/mask_scores.h"
#include "core/query/segmenter.h"

// From queries to scores: chooses a scale in three ways and scores the masks of each choice.

namespace pepeseg {

// A choice of scale and threshold for one entity, and its scores in the scored views.
struct ChoiceScores {
  double scale = 0;               // quantile; 0 if nothing was found under the prompt
  double threshold = 0;           // cosine
  MaskScores mean;                // over the scored views
  std::vector<MaskScores> views;  // [scored]
};

struct EntityScores {
  std::string name, category;
  std::string reference;             // view with the prompt
  std::vector<std::string> scored;   // views, by name
  std::vector<int64_t> num_pixels;   // [scored] pixels of the entity
  std::optional<PointPrompt> click;  // of a DeepestClick, pixels of the reference view
  bool missing = false;              // nothing was found under the prompt: all scores are 0
  ChoiceScores paper;  // has the best mean IoU of the scored views themselves: a bound
  // Chosen by the IoU in the reference view, see ReferenceRule. Absent if nothing is known there
  // (ReferenceTruthOf).
  std::optional<ChoiceScores> reference_choice;
  ChoiceScores automatic;            // chosen without any truth
  std::vector<double> iou_by_scale;  // [scales] at `fixed_threshold`, mean over the scored views
  // Of the protocol "clicks", which sets none of the choices.
  std::optional<EntityClicks> clicks;
};

// Returns the entity with its views and its click, without scores.
EntityScores WithoutScores(const EvaluationTask& task, const ScoredEntity& entity);

// How scale and threshold are chosen in the reference view.
enum class ReferenceRule {
  kBest,    // the best IoU, as the published protocols have it
  kCenter,  // the centre of what scores about best, see ChooseFromReference
};

// The thresholds to choose from.
struct ChoiceThresholds {
  std::vector<double> thresholds;  // cosines, ascending
  ReferenceRule rule = ReferenceRule::kCenter;
  double fixed_threshold = 0;  // of iou_by_scale
};

// Makes the mask of a query in a view, given by its index in the task.
using MaskInView = std::function<absl::StatusOr<BinaryMask>(size_t view, const Query& query)>;

// Scores the queries of all entities, [entities of the task], made for the scales of `query_task`.
// Among equally good choices of the scored views the one with the smaller scale is taken, then the
// one with the lower threshold. Works view by view: each feature map is rendered once for all
// choices, and once more for the scores of the chosen ones if it has left the cache. Calls
// `check_cancelled` before each scale of a view and each view's scores and returns its error.
//
// mask_in_view: makes the masks where they are not the pixels over a threshold. It is called view
// by view, forwards and then backwards. Its masks are the same at each threshold, and their borders
// are not refined. Empty: the pixels over the threshold.
absl::StatusOr<std::vector<EntityScores>> ScoreQueries(const QueryTask& query_task,
                                                       std::span<const EntityQueries> queries,
                                                       const ChoiceThresholds& choice,
                                                       const MaskInView& mask_in_view = {});

}  // namespace pepeseg
