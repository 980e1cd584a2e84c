#pragma once

#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/evaluate/one_click.h"
#include "core/evaluate/proposal_scores.h"
#include "core/query/segmenter.h"

namespace pepeseg {

// What a person who gives no scale and no threshold gets: IoU over an entity's scored views, mean
// over entities. No answer scores 0.
struct PromptScores {
  // The first proposal against whichever of the truth's levels it suits: is it a thing at all?
  double first_thing_iou = 0;
  // The mask of the reference view, as a label has it, and the box around it.
  double mask_iou = 0, box_iou = 0;
  // The selection in 3D that the mask makes, rendered back: against the truth, and against the
  // masks of the same query.
  double selection_iou = 0, selection_against_masks = 0;
  // What choosing a click's scale and threshold takes, on a view whose feature maps are there.
  double choosing_ms = 0;
};
// levels: the labels of every level of the truth, of the same views; `level`: the entities', of
// which `proposals` are.
absl::StatusOr<PromptScores> ScorePrompts(const Segmenter& segmenter,
                                          std::span<const std::vector<LabeledView>> levels,
                                          size_t level, std::span<const EntityScore> entities,
                                          const ProposalScores& proposals);

}  // namespace pepeseg
