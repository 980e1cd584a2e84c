#pragma once

#include <cstdint>

#include "core/sfm/sfm_options.h"

namespace pepeseg {

// Expected core seconds of the parts of stage "sfm": their shares tell how far it is.
struct SfmWork {
  double extracting = 0, matching = 0, mapping = 0;
  double sum() const { return extracting + matching + mapping; }
};

// Pairs of photographs that are compared.
int64_t NumSfmPairs(int64_t num_photographs, bool sequential, const SfmOptions& options);

// From tests/bench/results/bare_photographs.md (1 Mpx, 20 and 50 photographs, two cores).
SfmWork ExpectedSfmWork(int64_t num_photographs, int64_t num_pairs, const SfmOptions& options);

}  // namespace pepeseg
