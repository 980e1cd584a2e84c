#pragma once

#include <filesystem>
#include <span>
#include <string>

#include "absl/functional/function_ref.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/base/progress.h"
#include "core/sfm/sfm_options.h"
#include "core/sfm/sfm_photographs.h"
#include "kernels/backend.h"

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
  std::string program;                            // who placed them: "pepeseg", "COLMAP 3.8"
  int64_t num_registered = 0;
  double reprojection_error = 0;  // mean over the points, pixels
};

// The arithmetic of a run of the stage, and its reports. All are called on the calling thread.
struct SfmRun {
  Backend& backend;     // finds and matches features
  ProgressFn progress;  // called several times a second; an error that it returns ends the stage
  absl::FunctionRef<void(absl::string_view)>
      warn;  // called if COLMAP does what pepeseg failed to, or if poses are doubtful
};

// Estimates poses, lenses and sparse points of the photographs: features (core/sfm/features)
// -> matches (core/sfm/front) -> incremental mapping by COLMAP (written for 3.8) as a child
// process. COLMAP also does the first two if pepeseg fails to, or on request. Leaves the largest
// model in `places.result`. With the own front the same photographs give the same poses, whatever
// the number of threads; COLMAP's matcher draws depending on timing unless it has one thread.
//
// FAILED_PRECONDITION, with what to do: the program is not found, or the photographs do not suffice
// (CheckEnough, JudgeFeatures, JudgeModels). DEADLINE_EXCEEDED: it took longer than
// options.max_seconds. INTERNAL, with its last lines: the program failed. Errors of
// CompareInDatabase with SfmEngine::kOwn. Errors of run.progress.
absl::StatusOr<EstimatedPoses> EstimatePoses(std::span<const SfmPhotograph> photographs,
                                             const SfmPlaces& places, const SfmOptions& options,
                                             const SfmRun& run);

// Returns the peak host memory of EstimatePoses in bytes: that of finding features, unless COLMAP
// has to do it in pepeseg's place. `max_pixels` is the size of the largest photograph.
int64_t SfmHostBytes(int64_t max_pixels, int num_threads, const SfmOptions& options);

// Reads what an earlier EstimatePoses left in `result`. NOT_FOUND: it did not finish. Other errors:
// the files are damaged (VerifyManifest, ReadSfmModel).
absl::StatusOr<EstimatedPoses> ReadEstimatedPoses(const std::filesystem::path& result);

}  // namespace pepeseg
