#pragma once

#include <cstdint>

#include "absl/status/status.h"

namespace pepeseg {

// Which pairs of photographs are compared.
enum class SfmMatching {
  kByCapture = 0,   // sequential for frames of videos and for large numbered captures
  kExhaustive = 1,  // all with all
  kSequential = 2,  // each with its neighbours in the order of their numbers, and a few far ones
};

// Options of stage "sfm", which estimates the poses of photographs.
struct SfmOptions {
  SfmMatching matching = SfmMatching::kByCapture;
  // Number of SIFT features of a photograph, the largest first; those of the size at which the
  // number is reached are all kept. The time of matching grows with its square. [128, 32768].
  int max_features = 3000;
  // Sequential matching: number of following photographs that each is compared with. [1, 100].
  int sequential_overlap = 10;
  // Minimum share of the photographs that must get a pose, or else the stage fails. [0, 1].
  double min_registered_share = 0.5;
  // Time limit of the whole stage, seconds of wall-clock time. [1, 604800].
  int max_seconds = 4 * 3600;
  // Maximum number of frames taken from a video, spread over its duration. [3, 2000].
  int max_video_frames = 120;
};

// Returns INVALID_ARGUMENT, naming the option, its value and its range, if one is out of range.
absl::Status Validate(const SfmOptions& options);

// Expected work of the parts of stage "sfm" in core seconds. It weighs the parts in the progress of
// the stage and in estimates.
struct SfmWork {
  double extracting = 0, matching = 0, mapping = 0;
  double sum() const { return extracting + matching + mapping; }
};

// Returns the number of pairs of photographs that are compared, sequentially or all with all.
int64_t NumSfmPairs(int64_t num_photographs, bool sequential, const SfmOptions& options);

// Returns the expected work. The constants are measurements of
// tests/bench/results/bare_photographs.md (1 Mpx, 20 and 50 photographs, two cores).
SfmWork ExpectedSfmWork(int64_t num_photographs, int64_t num_pairs, const SfmOptions& options);

}  // namespace pepeseg
