#pragma once

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/evaluate/evaluation_task.h"
#include "core/query/segmenter.h"
#include "tests/bench/capture_pack.h"

namespace pepeseg {

// Agreement of a level of the decomposition at the default scales with ground truth, over the
// labelled pixels of all views together: an entity that is a different segment in each view lowers
// the scores.
struct DecompositionScores {
  double adjusted_rand = 0;
  double unassigned_share = 0;  // share of the labelled pixels
  // Share of entities that are mostly the same segment in each of their views. Counts entities that
  // at least two views show on 100 pixels or more: those of the task.
  double kept_share = 0;
  // Mean IoU of the same entities, over labelled pixels, with their best segment. Small entities
  // count as much as large ones.
  double best_iou = 0;
  int num_entities = 0;
  int num_segments = 0;  // of the level
};
absl::StatusOr<DecompositionScores> ScoreDecomposition(const Segmenter& segmenter, int level,
                                                       const EvaluationTask& task);

// Prints the scores of each level as comments of a table. Levels of the truth are matched to the
// default scales in order.
absl::Status PrintDecomposition(const Segmenter& segmenter, const CapturePack& pack);

}  // namespace pepeseg
