#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/statusor.h"
#include "core/evaluate/labeled_view.h"
#include "core/query/segmenter.h"

namespace pepeseg {

// A proposal for the click on an entity, and its IoU.
struct ProposalScore {
  double scale = 0;          // quantile, [0, 1]
  double threshold = 0;      // cosine
  double support = 0;        // see ScaleProposal
  double reference_iou = 0;  // on the clicked view
  double iou = 0;            // mean over the scored views
};

struct EntityProposals {
  int id = 0;
  PointPrompt click;                     // pixels of the reference view
  std::vector<ProposalScore> proposals;  // most support first; empty: no feature under the click
  // IoU, mean over the scored views, of the first proposal, and of the proposal with the best IoU
  // on the reference among the first three and among all. 0 without proposals.
  double first_iou = 0, best_of_three_iou = 0, best_iou = 0;
};

struct ProposalScores {
  std::vector<EntityProposals> entities;  // by id
  // Means over the entities.
  double first_iou = 0, best_of_three_iou = 0, best_iou = 0;
};

// Runs the best-of-three protocol: a person clicks once, looks at the masks of ProposeScales and
// takes the best one. SAM's three masks for a click are scored in this way (Kirillov et al. 2023,
// section 7.1). Entities, references and clicks are those of FindScoredEntities and FirstClick.
// Calls `check_cancelled` before each entity and returns its error. Returns INVALID_ARGUMENT for
// the reasons of FindScoredEntities.
absl::StatusOr<ProposalScores> EvaluateProposals(const Segmenter& segmenter,
                                                 std::span<const LabeledView> views,
                                                 int64_t min_pixels,
                                                 absl::FunctionRef<absl::Status()> check_cancelled);

}  // namespace pepeseg
