#pragma once

#include "absl/status/statusor.h"
#include "core/base/status_macros.h"
#include "core/features/trainer.h"
#include "core/reconstruct/trainer.h"
#include "core/train/run_stage.h"

namespace pepeseg::testing {

// Run stage one, and stage two, from start to end. Errors are those of the trainers and of
// `progress`, which is called for each report.
inline absl::StatusOr<Gaussians> TrainGaussians(Backend& backend, const Capture& capture,
                                                const ReconstructOptions& options,
                                                ProgressFn progress) {
  ASSIGN_OR_RETURN(const auto trainer, GaussianTrainer::Create(backend, capture, options));
  return RunSteps(*trainer, progress);
}
inline absl::StatusOr<FeatureField> TrainFeatures(Backend& backend, const Capture& capture,
                                                  const Gaussians& gaussians,
                                                  const FeatureOptions& options,
                                                  ProgressFn progress) {
  ASSIGN_OR_RETURN(const auto trainer,
                   FeatureTrainer::Create(backend, capture, gaussians, options));
  return RunSteps(*trainer, progress);
}

}  // namespace pepeseg::testing
