#pragma once

#include <span>

#include "absl/status/statusor.h"
#include "core/evaluate/one_click.h"
#include "core/query/segmenter.h"

namespace pepeseg {

// What a person who gives no scale gets: IoU over an entity's scored views, mean over entities, of
// the first proposal and of the one that suits the reference view best. No proposal scores 0.
struct ProposalScores {
  double first_iou = 0, best_iou = 0;
};
absl::StatusOr<ProposalScores> ScoreProposals(const Segmenter& segmenter,
                                              std::span<const LabeledView> views,
                                              std::span<const EntityScore> entities);

}  // namespace pepeseg
