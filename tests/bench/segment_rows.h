#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/evaluate/evaluate.h"
#include "core/scene/gaussians.h"
#include "tests/bench/capture_pack.h"

namespace pepeseg {

// Result of stage one. seconds < 0: read from a file instead of trained.
struct Geometry {
  Gaussians gaussians;
  double seconds = -1, core_seconds = 0;
  int64_t num_steps = 0;  // done
  ImageScores held_out;   // mean over the held-out views
  double least_psnr = 0;  // of the worst held-out view
};

// One row of the table.
struct SegmentRow {
  uint64_t seed;
  const TruthLevel* level;
  const Geometry* geometry;
  double feature_seconds, feature_core_seconds, evaluate_seconds;
  int64_t num_feature_steps;
  size_t bytes;             // peak device memory so far
  EvaluationResult scores;  // of the protocol "one click"
};

void PrintHeader(const EvaluationOptions& protocol);
// Prints a row of the table; `name` is the first column.
void PrintRow(const std::string& name, const SegmentRow& row);
// Prints a line for each entity, as comments, so that scripts can extract the rows of the table.
void PrintEntities(const SegmentRow& row);
// Prints the means of the protocol "clicks" as a comment, and with `by_entity` another comment for
// each entity and its answers.
void PrintClicks(const SegmentRow& row, const ClickOptions& options, const EvaluationResult& scores,
                 bool by_entity);
}  // namespace pepeseg
