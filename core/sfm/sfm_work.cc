#include "core/sfm/sfm_work.h"

#include <algorithm>

namespace pepeseg {
namespace {

constexpr double kExtractingSeconds = 1.5;  // a photograph
constexpr double kMatchingSeconds = 0.3;    // a pair with `kFeatures` features each
constexpr double kFeatures = 3000;
constexpr double kMappingSeconds = 0.7;  // a photograph

}  // namespace

int64_t NumSfmPairs(int64_t num_photographs, bool sequential, const SfmOptions& options) {
  const int64_t n = num_photographs;
  const int64_t all = n * (n - 1) / 2;
  if (!sequential) return all;
  // The next `overlap` ones and, of the farther ones, those at powers of two.
  int64_t pairs = n * options.sequential_overlap;
  for (int64_t distance = 1; distance < n; distance *= 2) {
    if (distance > options.sequential_overlap) pairs += n - distance;
  }
  return std::min(all, pairs);
}

SfmWork ExpectedSfmWork(int64_t num_photographs, int64_t num_pairs, const SfmOptions& options) {
  const auto n = static_cast<double>(num_photographs);
  const double features = options.max_features / kFeatures;
  return {.extracting = kExtractingSeconds * n,
          .matching = kMatchingSeconds * static_cast<double>(num_pairs) * features * features,
          .mapping = kMappingSeconds * n};
}

}  // namespace pepeseg
