#pragma once

#include <cstdint>

#include "absl/status/status.h"
#include "core/base/options.h"
#include "core/sfm/front/compare_photographs.h"

namespace pepeseg {

// Which pairs of photographs are compared.
enum class SfmMatching {
  kByCapture = 0,   // sequential for frames of videos and for large numbered captures
  kExhaustive = 1,  // all with all
  kSequential = 2,  // each with its neighbours in the order of their numbers, and a few far ones
};

// Who does a part of the stage.
enum class SfmEngine {
  kAuto = 0,    // pepeseg, and COLMAP if that fails
  kOwn = 1,     // pepeseg; the stage fails if that fails
  kColmap = 2,  // COLMAP
};

// With SfmEngine::kAuto, COLMAP maps fewer photographs than this, in less than a core second: the
// own mapper was not compared on fewer (tests/bench/results/poses.md).
inline constexpr int64_t kFewestForOwnMapper = 10;

// Options of stage "sfm", which estimates the poses of photographs.
struct SfmOptions {
  // Rule for the photographs that are matched with each other.
  SfmMatching matching = SfmMatching::kByCapture;
  // Number of SIFT features of a photograph, the largest first; those of the size at which the
  // number is reached are all kept. The time of matching grows with its square.
  int max_features = 3000;
  // Sequential matching: number of following photographs that each is compared with.
  int sequential_overlap = 10;
  // Minimum share of the photographs that must get a pose, or else the stage fails.
  double min_registered_share = 0.5;
  // Time limit of the whole stage, seconds of wall-clock time.
  int max_seconds = 4 * 3600;
  // Maximum number of frames taken from a video, spread over its duration.
  int max_video_frames = 120;
  // Who matches features and verifies the matches (core/sfm/front). COLMAP's mapper runs with fewer
  // rounds of bundle adjustment on own matches, see incremental_mapping.cc.
  SfmEngine front = SfmEngine::kAuto;
  // Who finds features (core/sfm/features).
  SfmEngine features = SfmEngine::kAuto;
  // Who places the photographs (core/sfm/mapper). auto: COLMAP if it matched them, or if there are
  // fewer than 10.
  SfmEngine mapper = SfmEngine::kAuto;
};
// Passes each option with its range to `visit`.
void VisitOptions(SfmOptions& options, OptionVisitor visit);

// Returns INVALID_ARGUMENT, naming the option, its value and its range, if one is out of range.
absl::Status Validate(const SfmOptions& options);

// Numbers on which the work of the stage depends.
struct SfmLoad {
  int64_t num_photographs = 0;
  double megapixels = 1;     // of a photograph
  bool in_sequence = false;  // photographs are frames of a video
  bool on_device = false;    // a GPU finds and matches features
};

// Returns how the own front compares the photographs, but for its number of threads.
ComparisonOptions ComparisonFor(const SfmLoad& load, const SfmOptions& options);

// Returns the number of pairs of photographs that are scored, and of those that are compared.
// `load` says whether COLMAP matches in sequence as well.
NumPairs NumSfmPairs(const SfmLoad& load, const SfmOptions& options);

// Expected work of the parts of stage "sfm" in core seconds. It weighs the parts in the progress of
// the stage and in estimates.
struct SfmWork {
  double extracting = 0, choosing = 0, matching = 0, mapping = 0;
  double mapping_threads = 1;  // that the mapper uses on average where there are many; others: all
  double sum() const { return extracting + choosing + matching + mapping; }
};

// Returns the expected work. The constants are measurements of tests/bench/results/poses.md.
SfmWork ExpectedSfmWork(const SfmLoad& load, const SfmOptions& options);

}  // namespace pepeseg
