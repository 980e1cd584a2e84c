#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/features/feature_stage.h"
#include "core/model_files/checkpoint.h"
#include "core/reconstruct/reconstructor.h"
#include "core/train/training_observer.h"

namespace pepeseg {

// Return stage one or two, resumed from its farthest good checkpoint or started at step 0.
// checkpoints: null if none are kept. A checkpoint that does not fit is passed over; other errors
// are those of Reconstructor::Create and FeatureStage::Create.
absl::StatusOr<std::unique_ptr<Reconstructor>> StartReconstruction(
    StageCheckpoints* checkpoints, Backend& backend, const Capture& capture,
    const ReconstructOptions& options);
absl::StatusOr<std::unique_ptr<FeatureStage>> StartFeatures(StageCheckpoints* checkpoints,
                                                            Backend& backend,
                                                            const Capture& capture,
                                                            const Gaussians& gaussians,
                                                            const FeatureOptions& options);

// Writes a checkpoint after a step if one is due or if the report of the step cancelled the
// training. Returns `status`, the result of that report. step: the number of steps that `stage` has
// done, which may be more than it has reported. Without `checkpoints` only returns `status`.
template <class Stage>
absl::Status SaveStep(absl::Status status, int64_t step, Stage& stage,
                      StageCheckpoints* checkpoints) {
  if (checkpoints == nullptr) return status;
  const auto write = [&](const std::filesystem::path& path,
                         const CheckpointHeader& header) -> absl::Status {
    const auto checkpoint = stage.Save();
    if (!checkpoint.ok()) return checkpoint.status();
    const absl::Status valid = Validate(*checkpoint);
    return valid.ok() ? WriteCheckpoint(path, header, SectionsOf(*checkpoint)) : valid;
  };
  if (absl::IsCancelled(status)) checkpoints->Save(step, write);
  if (status.ok()) checkpoints->SaveIfDue(step, write);
  return status;
}

}  // namespace pepeseg
