#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "core/sfm/sfm_options.h"

// Whether an attempt to estimate poses has succeeded, and what its owner reads: which photographs
// failed, by their names, why, and what to do.
namespace pepeseg {

// Findings of an attempt to estimate poses, so far.
struct SfmEvidence {
  std::vector<std::string> names;     // of the photographs, as their owner named them
  std::vector<int64_t> num_features;  // of each photograph
  int64_t num_connected = -1;         // photographs that match another one; -1: unknown
  // Number of photographs that each matches (PairEvidence). Empty: COLMAP matched, it is unknown.
  std::vector<int64_t> num_partners;
  bool turns_on_the_spot = false;  // see PairEvidence
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

// Returns a warning that names the photographs without a pose in the largest model, and says why
// they have none: too few features, nothing in common with others, or too little. Empty: all have a
// pose.
std::string DescribeUnplaced(const SfmEvidence& evidence);

// Returns a warning that a model contradicts matches of its photographs (ModelAgreement): their
// share, the names of `doubtful` photographs, and what to do.
std::string DescribeDisagreement(const SfmEvidence& evidence, int64_t agreeing, int64_t disagreeing,
                                 const std::vector<size_t>& doubtful);

// Returns a warning that there are poses although the camera seems to have turned on the spot.
std::string DescribeTurn(const SfmEvidence& evidence);

}  // namespace pepeseg
