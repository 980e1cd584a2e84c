#pragma once

#include <vector>

#include "absl/status/status.h"
#include "core/dataset/import.h"
#include "server/worker/worker_job.h"
#include "server/worker/worker_stage_log.h"

namespace pepeseg {

// Has each HEIC photograph among `files` stand in a JPEG of this attempt, under the same name: what
// runs afterwards, COLMAP and priors commands too, reads those. From an earlier attempt of the job
// where it came so far. Steps of the stage "prepare". Errors as HeicToJpeg.
absl::Status ConvertHeicPhotographs(const WorkerJob& job, StageLog& stages,
                                    std::vector<DatasetFile>& files);

}  // namespace pepeseg
