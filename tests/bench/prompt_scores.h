#pragma once

#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/evaluate/evaluation_task.h"
#include "core/query/segmenter.h"

namespace pepeseg {

// A proposal for the click on an entity, and its IoU.
struct ProposalScore {
  double scale = 0;          // quantile, [0, 1]
  double threshold = 0;      // cosine
  double support = 0;        // see Candidate
  double reference_iou = 0;  // on the clicked view
  double iou = 0;            // mean over the scored views
};

struct EntityProposals {
  std::vector<ProposalScore> proposals;  // most support first; empty: no feature under the click
  // IoU, mean over the scored views, of the first proposal, and of the proposal with the best IoU
  // on the reference among the first three and among all. 0 without proposals.
  double first_iou = 0, best_of_three_iou = 0, best_iou = 0;
};

// Runs the best-of-three protocol on an entity of a task: a person clicks its deepest pixel once,
// looks at the masks of Propose and takes the best one. SAM's three masks for a click are
// scored in this way (Kirillov et al. 2023, section 7.1).
absl::StatusOr<EntityProposals> ScoreProposals(const Segmenter& segmenter,
                                               const EvaluationTask& task,
                                               const ScoredEntity& entity);

// Scores of prompts without scale and threshold: IoU over an entity's scored views, mean over the
// entities. A click without a proposal scores 0.
struct PromptScores {
  // See EntityProposals.
  double first_iou = 0, best_of_three_iou = 0, best_iou = 0;
  // IoU of the first proposal with the best entity at any level of the truth: does it show a thing?
  double first_thing_iou = 0;
  // Prompts by the labelled mask in the reference view, and by the box around it.
  double mask_iou = 0, box_iou = 0;
  // The 3D selection by the mask, rendered back: IoU with the truth, and with the masks of the same
  // query.
  double selection_iou = 0, selection_against_masks = 0;
  // Time to choose scale and threshold of a click on a view whose feature maps are cached, ms.
  double choosing_ms = 0;
};
// Scores the entities of a task of one level of the truth. `levels` has the same views at every
// level.
absl::StatusOr<PromptScores> ScorePrompts(const Segmenter& segmenter, const EvaluationTask& task,
                                          std::span<const std::vector<TruthView>> levels);

}  // namespace pepeseg
