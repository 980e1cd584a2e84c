#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/dataset/import.h"
#include "core/sfm/sfm_options.h"
#include "core/sfm/sfm_photographs.h"
#include "server/worker/worker_job.h"
#include "server/worker/worker_stage_log.h"

namespace pepeseg {

// Appends the frames that stand for the videos among `files`, as photographs; from an earlier
// attempt of the job where it came so far. Steps of the stage "prepare". Errors as ExtractFrames.
absl::Status AppendVideoFrames(const WorkerJob& job, const SfmOptions& options, StageLog& stages,
                               std::vector<DatasetFile>& files);

// The photographs among the files, checked by their first bytes. INVALID_ARGUMENT also: a file that
// belongs to given poses, where none are given.
absl::StatusOr<std::vector<SfmPhotograph>> PhotographsWithoutPoses(
    const WorkerJob& job, const std::vector<DatasetFile>& files);

struct PosesMade {
  std::string source;  // the program and its version
  std::map<std::string, double> metrics;
};

// Appends COLMAP's files with the poses of the photographs; from an earlier attempt of the job
// where it came so far. Steps of the stage "sfm". Errors as EstimatePoses.
absl::StatusOr<PosesMade> AppendPoses(const WorkerJob& job, const SfmOptions& options,
                                      StageLog& stages,
                                      const std::vector<SfmPhotograph>& photographs,
                                      std::vector<DatasetFile>& files);

}  // namespace pepeseg
