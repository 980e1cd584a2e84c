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

namespace pepeseg {

// Returns the photographs among the files, checked by their first bytes. INVALID_ARGUMENT also when
// a file is among them that belongs to given poses, since none are given.
absl::StatusOr<std::vector<SfmPhotograph>> PhotographsWithoutPoses(
    const std::vector<DatasetFile>& files, const TrainingFolders& folders);

struct PosesMade {
  std::string source;         // the program and its version
  StageLog::Metrics metrics;  // "num_registered", "num_photographs", "reprojection_error"
};

// Estimates the photographs' poses and appends COLMAP's files with them to `files`. Takes them from
// an earlier run that has estimated them. Reports steps of stage "sfm". Errors as EstimatePoses.
absl::StatusOr<PosesMade> AppendPoses(const TrainingInputs& inputs, const SfmOptions& options,
                                      const std::vector<SfmPhotograph>& photographs,
                                      StageLog& stages, std::vector<DatasetFile>& files);

}  // namespace pepeseg
