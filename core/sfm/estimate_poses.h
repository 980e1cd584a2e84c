#pragma once

#include <filesystem>
#include <span>
#include <string>

#include "absl/status/statusor.h"
#include "core/base/progress.h"
#include "core/sfm/sfm_options.h"
#include "core/sfm/sfm_photographs.h"

namespace pepeseg {

// Programs and folders of the stage "sfm".
struct SfmPlaces {
  std::string program = "colmap";  // a path, or a name to look up in PATH
  std::filesystem::path work;      // a folder that is emptied first and removed at the end
  std::filesystem::path result;    // a folder, replaced at the end; see ReadEstimatedPoses
  std::filesystem::path log;       // the program's output is appended
  int num_threads = 0;             // 0: one for each core
};

struct EstimatedPoses {
  std::filesystem::path cameras, images, points;  // COLMAP's files, with the owner's image names
  std::string program;                            // "COLMAP 3.8"
  int64_t num_registered = 0;
  double reprojection_error = 0;  // mean over the points, pixels
};

// Estimates poses, lenses and sparse points of the photographs with COLMAP (written for 3.8) as a
// child process: features -> matches -> incremental mapping. Leaves the largest model in
// `places.result`. Uses no GPU. Calls `progress` on this thread about every 50 ms while a command
// runs; an error that it returns kills the program and is returned. With one thread the same
// photographs give the same poses; with several, the random draws of RANSAC depend on timing.
//
// FAILED_PRECONDITION, with what to do: the program is not found, or the photographs do not suffice
// (CheckEnough, JudgeFeatures, JudgeModels). DEADLINE_EXCEEDED: it took longer than
// options.max_seconds. INTERNAL, with its last lines: the program failed.
absl::StatusOr<EstimatedPoses> EstimatePoses(std::span<const SfmPhotograph> photographs,
                                             const SfmPlaces& places, const SfmOptions& options,
                                             ProgressFn progress);

// Returns the peak host memory of EstimatePoses in bytes: SIFT's image pyramids of the photographs
// that are processed at the same time. `max_pixels` is the size of the largest photograph.
int64_t SfmHostBytes(int64_t max_pixels, int num_threads);

// Reads what an earlier EstimatePoses left in `result`. NOT_FOUND: it did not finish. Other errors:
// the files are damaged (VerifyManifest, ReadSfmModel).
absl::StatusOr<EstimatedPoses> ReadEstimatedPoses(const std::filesystem::path& result);

}  // namespace pepeseg
