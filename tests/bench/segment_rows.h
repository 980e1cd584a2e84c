#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "core/evaluate/click_count.h"
#include "core/evaluate/labeled_view.h"
#include "core/evaluate/one_click.h"
#include "core/query/segmenter.h"
#include "core/scene/gaussians.h"
#include "core/scene/model.h"
#include "tests/bench/capture_pack.h"

namespace pepeseg {

// What stage one leaves; seconds below 0: it was read.
struct Geometry {
  Gaussians gaussians;
  double seconds = -1, core_seconds = 0;
  int64_t num_steps = 0;  // done
  ImageScores held_out;
};

// One row of the table.
struct SegmentRow {
  uint64_t seed;
  const TruthLevel* level;
  const Geometry* geometry;
  double feature_seconds, feature_core_seconds, evaluate_seconds;
  int64_t num_feature_steps;
  size_t bytes;  // of the device, at most so far
  OneClickScores scores;
};

void PrintHeader(const OneClickOptions& protocol);
// `name`: the first column.
void PrintRow(const std::string& name, const SegmentRow& row);
// A line for each entity: as comments, so that the table's rows can be cut out.
void PrintEntities(const SegmentRow& row);
// A comment with the means, and with `by_entity` one for each entity with its answers.
void PrintClicks(const SegmentRow& row, const ClickOptions& options, const ClickScores& scores,
                 bool by_entity);
// A PPM an entity and view: white where it is right, red where it says too much, blue too little.
absl::Status DumpMasks(const Segmenter& segmenter, const std::vector<LabeledView>& views,
                       const SegmentRow& row, const std::string& folder);

}  // namespace pepeseg
