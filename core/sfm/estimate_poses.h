#pragma once

#include <filesystem>
#include <span>
#include <string>

#include "absl/status/statusor.h"
#include "core/base/progress.h"
#include "core/sfm/sfm_options.h"
#include "core/sfm/sfm_photographs.h"

namespace pepeseg {

// Where the stage "sfm" finds and leaves its things.
struct SfmPlaces {
  std::string program = "colmap";  // a path, or a name that is looked for in PATH
  std::filesystem::path work;      // a folder that is made anew, and removed at the end
  std::filesystem::path result;    // a folder, see ReadEstimatedPoses
  std::filesystem::path log;       // the program's words are appended
  int num_threads = 0;             // 0: as many as there are cores
};

struct EstimatedPoses {
  std::filesystem::path cameras, images, points;  // COLMAP's files, with the photographs' own names
  std::string program;                            // "COLMAP 3.8"
  int64_t num_registered = 0;
  double reprojection_error = 0;  // mean over the points, pixels
};

// Poses, lenses and sparse points of the photographs, by COLMAP (written for 3.8) as a child
// process: features -> matches -> incremental mapping -> the largest model, in `places.result`. It
// uses no GPU. `progress`: called at least ten times a second, its error kills the program and is
// answered. The same photographs give the same poses with one thread; with more of them, RANSAC's
// draws fall to the threads as they come.
//
// FAILED_PRECONDITION, with what to do: the program is not there, or the photographs do not give
// poses (CheckEnough, JudgeFeatures, JudgeModels). DEADLINE_EXCEEDED: over options.max_seconds.
// INTERNAL: the program failed, with its last lines.
absl::StatusOr<EstimatedPoses> EstimatePoses(std::span<const SfmPhotograph> photographs,
                                             const SfmPlaces& places, const SfmOptions& options,
                                             ProgressFn progress);

// Host memory that it takes at most, bytes: SIFT's pyramids of the photographs that are read at the
// same time. `max_pixels`: of the largest.
int64_t SfmHostBytes(int64_t max_pixels, int num_threads);

// What an earlier EstimatePoses has left in `result`. NOT_FOUND: it did not come to its end.
absl::StatusOr<EstimatedPoses> ReadEstimatedPoses(const std::filesystem::path& result);

}  // namespace pepeseg
