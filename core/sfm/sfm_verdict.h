#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "core/sfm/sfm_options.h"

namespace pepeseg {

// What is known of an attempt to estimate poses.
struct SfmEvidence {
  std::vector<std::string> names;           // of the photographs, their owner's
  std::vector<int64_t> num_features;        // of each
  int64_t num_connected = -1;               // that match another one; -1: not known
  std::vector<std::vector<size_t>> models;  // photographs with a pose, the largest model first
};

// Before anything is matched. FAILED_PRECONDITION names photographs in which too little is to be
// seen, where too few others are left.
absl::Status JudgeFeatures(const SfmEvidence& evidence, const SfmOptions& options);

// Whether the largest model will do. FAILED_PRECONDITION: too few photographs have a pose, or many
// of the others have theirs in a model of their own; with counts, the first names, and what to do
// about the likely cause.
absl::Status JudgeModels(const SfmEvidence& evidence, const SfmOptions& options);

}  // namespace pepeseg
