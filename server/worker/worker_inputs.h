#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/dataset/import.h"
#include "core/scene/capture.h"
#include "server/api/convert.h"
#include "server/worker/worker_job.h"
#include "server/worker/worker_stage_log.h"

namespace pepeseg {

// What a training starts from.
struct SceneInputs {
  Capture capture;
  std::optional<DatasetFile> gaussians;  // given in place of stage one's
  // Where each came from, as model facts: "poses", "masks", "depth".
  std::map<std::string, std::string> sources;
};

// The stages before the first: prepare (files to views) -> sfm (poses, where none are given) ->
// priors (masks and depth, where none are given). Each is skipped when its result was uploaded.
// Where SAM makes the masks, it begins with sfm.
// INVALID_ARGUMENT names the file of the dataset that is wrong; DATA_LOSS one whose stored bytes
// are damaged; FAILED_PRECONDITION: the photographs do not give poses, and what to do; CANCELLED:
// the job was told to stop.
absl::StatusOr<SceneInputs> MakeSceneInputs(const WorkerJob& job, const TrainingSettings& settings,
                                            StageLog& stages);

// Whether those stages have to run a program for the job: COLMAP, or the priors command.
bool RunsPrograms(const JobSpec& spec, const PriorsCommand& priors);

}  // namespace pepeseg
