#pragma once

#include <span>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/evaluate/labeled_view.h"
#include "core/query/segmenter.h"
#include "tests/bench/capture_pack.h"

namespace pepeseg {

// How a level of the decomposition at the default scales agrees with ground truth, over the
// labelled pixels of all views together: a segment that is two in two views counts against it.
struct DecompositionScores {
  double adjusted_rand = 0;
  double unassigned_share = 0;  // of the labelled pixels
  // Of the entities that at least two views show on 100 pixels or more: the share of which each
  // view shows the same segment on most of its pixels.
  double kept_share = 0;
  // Of the same: mean IoU, over labelled pixels, with the segment that fits best. Small entities
  // count as much as large ones.
  double best_iou = 0;
  int num_entities = 0;
  int num_segments = 0;  // of the level
};
absl::StatusOr<DecompositionScores> ScoreDecomposition(const Segmenter& segmenter, int level,
                                                       std::span<const LabeledView> views);

// Of each level, as comments of a table. The levels of the truth are matched to the default scales
// in their order.
absl::Status PrintDecomposition(const Segmenter& segmenter, const CapturePack& pack);

}  // namespace pepeseg
