#include "core/sfm/sfm_options.h"

#include <algorithm>

#include "core/base/errors.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

constexpr double kExtractingSeconds = 1.5;  // for each photograph
constexpr double kMatchingSeconds = 0.3;  // for each pair with `kFeatures` features per photograph
constexpr double kFeatures = 3000;
constexpr double kMappingSeconds = 0.7;  // for each photograph

}  // namespace

absl::Status Validate(const SfmOptions& options) {
  RETURN_IF_ERROR(CheckInRange("matching", static_cast<int>(options.matching), 0,
                               static_cast<int>(SfmMatching::kSequential)));
  RETURN_IF_ERROR(CheckInRange("max_features", options.max_features, 128, 32768));
  RETURN_IF_ERROR(CheckInRange("sequential_overlap", options.sequential_overlap, 1, 100));
  RETURN_IF_ERROR(CheckInRange("max_seconds", options.max_seconds, 1, 7 * 24 * 3600));
  RETURN_IF_ERROR(CheckInRange("max_video_frames", options.max_video_frames, 3, 2000));
  return CheckInRange("min_registered_share", options.min_registered_share, 0.0, 1.0);
}

int64_t NumSfmPairs(int64_t num_photographs, bool sequential, const SfmOptions& options) {
  const int64_t n = num_photographs;
  const int64_t all = n * (n - 1) / 2;
  if (!sequential) return all;
  // The next `sequential_overlap` photographs and, beyond them, those at distances that are powers
  // of two (COLMAP's quadratic_overlap).
  // An upper bound: the last photographs have fewer successors. Limited to all pairs below.
  int64_t pairs = n * options.sequential_overlap;
  for (int64_t distance = 1; distance < n; distance *= 2) {
    if (distance > options.sequential_overlap) pairs += n - distance;
  }
  return std::min(all, pairs);
}

SfmWork ExpectedSfmWork(int64_t num_photographs, int64_t num_pairs, const SfmOptions& options) {
  const auto n = static_cast<double>(num_photographs);
  // A pair compares each feature of one photograph with each of the other.
  const double features = options.max_features / kFeatures;
  return {.extracting = kExtractingSeconds * n,
          .matching = kMatchingSeconds * static_cast<double>(num_pairs) * features * features,
          .mapping = kMappingSeconds * n};
}

}  // namespace pepeseg
