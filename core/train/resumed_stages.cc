#include "core/train/resumed_stages.h"

#include "core/base/status_macros.h"

namespace pepeseg {

absl::StatusOr<std::unique_ptr<Reconstructor>> StartReconstruction(
    StageCheckpoints* checkpoints, Backend& backend, const Capture& capture,
    const ReconstructOptions& options) {
  // `use` returns an error for a checkpoint that does not fit: the next one is then offered.
  std::unique_ptr<Reconstructor> stage;
  const auto use = [&](const Checkpoint& file) -> absl::Status {
    ASSIGN_OR_RETURN(const ReconstructCheckpoint state, ReconstructCheckpointOf(file.sections));
    ASSIGN_OR_RETURN(stage, Reconstructor::Resume(backend, capture, options, state));
    return absl::OkStatus();
  };
  if (checkpoints != nullptr) checkpoints->Resume(use);
  if (stage != nullptr) return stage;
  return Reconstructor::Create(backend, capture, options);
}

absl::StatusOr<std::unique_ptr<FeatureStage>> StartFeatures(StageCheckpoints* checkpoints,
                                                            Backend& backend,
                                                            const Capture& capture,
                                                            const Gaussians& gaussians,
                                                            const FeatureOptions& options) {
  std::unique_ptr<FeatureStage> stage;
  // As above: an error makes the next checkpoint be offered.
  const auto use = [&](const Checkpoint& file) -> absl::Status {
    ASSIGN_OR_RETURN(const FeatureCheckpoint state, FeatureCheckpointOf(file.sections));
    ASSIGN_OR_RETURN(stage, FeatureStage::Resume(backend, capture, gaussians, options, state));
    return absl::OkStatus();
  };
  if (checkpoints != nullptr) checkpoints->Resume(use);
  if (stage != nullptr) return stage;
  return FeatureStage::Create(backend, capture, gaussians, options);
}

}  // namespace pepeseg
