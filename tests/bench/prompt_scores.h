#pragma once

#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/evaluate/one_click.h"
#include "core/evaluate/proposal_scores.h"
#include "core/query/segmenter.h"

namespace pepeseg {

// Scores of prompts without scale and threshold: IoU over an entity's scored views, mean over the
// entities. A prompt without an answer scores 0.
struct PromptScores {
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
// Scores the entities of one level of the truth. `levels` has the labels of every level for the
// same views; `entities` and `proposals` belong to `level`.
absl::StatusOr<PromptScores> ScorePrompts(const Segmenter& segmenter,
                                          std::span<const std::vector<LabeledView>> levels,
                                          size_t level, std::span<const EntityScore> entities,
                                          const ProposalScores& proposals);

}  // namespace pepeseg
