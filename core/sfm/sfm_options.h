#pragma once

#include <cstdint>

#include "absl/status/status.h"

namespace pepeseg {

// Which photographs are compared with which.
enum class SfmMatching {
  kByCapture = 0,   // sequential for frames of videos and for large numbered captures
  kExhaustive = 1,  // all with all
  kSequential = 2,  // each with those about it in the order of their numbers, and a few far ones
};

// Stage "sfm": from photographs to poses.
struct SfmOptions {
  SfmMatching matching = SfmMatching::kByCapture;
  // SIFT features of a photograph, from the largest: as many, and the rest of the size at which
  // that number is reached. The time of matching grows as the square. [128, 32768].
  int max_features = 3000;
  // Sequential matching: how many photographs follow that each is compared with.
  int sequential_overlap = 10;
  // The stage fails when a smaller share of the photographs gets a pose. [0, 1].
  double min_registered_share = 0.5;
  // For the whole stage, on however many threads the job has.
  int max_seconds = 4 * 3600;
  // Frames taken from a video, spread over its time. 3 to 2000.
  int max_video_frames = 120;
};

// INVALID_ARGUMENT names the option, its value and its range.
absl::Status Validate(const SfmOptions& options);

}  // namespace pepeseg
