#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/features/feature_stage.h"
#include "core/model_files/checkpoint.h"
#include "core/reconstruct/reconstructor.h"
#include "server/worker/worker_checkpoints.h"

namespace pepeseg {

// The stages from their farthest good checkpoint, or anew, with the errors of that.
absl::StatusOr<std::unique_ptr<Reconstructor>> BeginReconstruction(
    WorkerCheckpoints& checkpoints, Backend& backend, const Capture& capture,
    const ReconstructOptions& options);
absl::StatusOr<std::unique_ptr<FeatureStage>> BeginFeatures(WorkerCheckpoints& checkpoints,
                                                            Backend& backend,
                                                            const Capture& capture,
                                                            const Gaussians& gaussians,
                                                            const FeatureOptions& options);

// After a step, `status` of which is handed on: a checkpoint where one is due, or where the step
// was told to stop. `step`: where the stage stands, which may be ahead of what it has reported.
template <class Stage>
absl::Status SaveStep(absl::Status status, int64_t step, Stage& stage,
                      WorkerCheckpoints& checkpoints) {
  const auto write = [&](const std::filesystem::path& path,
                         const CheckpointHeader& header) -> absl::Status {
    const auto checkpoint = stage.Save();
    if (!checkpoint.ok()) return checkpoint.status();
    const absl::Status valid = Validate(*checkpoint);
    return valid.ok() ? WriteCheckpoint(path, header, SectionsOf(*checkpoint)) : valid;
  };
  if (absl::IsCancelled(status)) checkpoints.Save(step, write);
  if (status.ok()) checkpoints.SaveIfDue(step, write);
  return status;
}

}  // namespace pepeseg
