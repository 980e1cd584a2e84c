#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/dataset/import.h"
#include "core/sfm/sfm_options.h"
#include "core/sfm/sfm_photographs.h"
#include "core/train/stage_log.h"
#include "core/train/training_inputs.h"
#include "core/train/training_metrics.h"
#include "kernels/backend.h"

namespace pepeseg {

// Returns the photographs among the files of a dataset without poses, checked by their first bytes.
// Returns INVALID_ARGUMENT for a wrong photograph, and for Gaussians or points, whose coordinates
// belong to poses that are not given.
absl::StatusOr<std::vector<SfmPhotograph>> PhotographsWithoutPoses(
    const std::vector<DatasetFile>& files, const TrainingFolders& folders);

// Origin and quality of estimated poses.
struct PosesMade {
  std::string program;      // with its version
  TrainingMetrics metrics;  // num_registered, num_photographs, reprojection_error
};

// Estimates the photographs' poses, or takes them from an earlier run, and appends COLMAP's files
// with them to `files`. Reports steps of stage "sfm". Returns the errors of EstimatePoses.
absl::StatusOr<PosesMade> AppendPoses(const TrainingInputs& inputs, const SfmOptions& options,
                                      const std::vector<SfmPhotograph>& photographs,
                                      Backend& backend, StageLog& stages,
                                      std::vector<DatasetFile>& files);

}  // namespace pepeseg
