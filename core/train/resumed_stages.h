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

// Stage one or two, from its farthest good checkpoint, else from step 0. `checkpoints` is null
// where none are kept. Errors as those of a start from step 0.
absl::StatusOr<std::unique_ptr<Reconstructor>> StartReconstruction(
    StageCheckpoints* checkpoints, Backend& backend, const Capture& capture,
    const ReconstructOptions& options);
absl::StatusOr<std::unique_ptr<FeatureStage>> StartFeatures(StageCheckpoints* checkpoints,
                                                            Backend& backend,
                                                            const Capture& capture,
                                                            const Gaussians& gaussians,
                                                            const FeatureOptions& options);

// Called after a step that was reported with the result `status`, which it returns. Writes a
// checkpoint when one is due, or when the report cancelled the training. `step`: the steps that
// `stage` has done, which may be more than it has reported.
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
