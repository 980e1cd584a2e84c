#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "core/sfm/sfm_options.h"

namespace pepeseg {

// What an attempt to estimate poses has found so far.
struct SfmEvidence {
  std::vector<std::string> names;     // of the photographs, as their owner named them
  std::vector<int64_t> num_features;  // of each photograph
  int64_t num_connected = -1;         // photographs that match another one; -1: unknown
  // Indices of the photographs that have a pose in each model, the largest model first.
  std::vector<std::vector<size_t>> models;
};

// Decides before matching whether enough photographs have features. If not, returns
// FAILED_PRECONDITION, naming those with too few.
absl::Status JudgeFeatures(const SfmEvidence& evidence, const SfmOptions& options);

// Decides whether the largest model is good enough. Returns FAILED_PRECONDITION if too few
// photographs have a pose in it, or if many others have theirs in a second model. The message has
// counts, the first names, and what to do about the likely cause.
absl::Status JudgeModels(const SfmEvidence& evidence, const SfmOptions& options);

// Returns a warning that a model contradicts matches of its photographs (ModelAgreement): their
// share, the names of `doubtful` photographs, and what to do.
std::string DescribeDisagreement(const SfmEvidence& evidence, int64_t agreeing, int64_t disagreeing,
                                 const std::vector<size_t>& doubtful);

}  // namespace pepeseg
