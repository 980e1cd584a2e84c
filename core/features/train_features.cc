#include "core/features/train_features.h"

#include <memory>

#include "core/base/status_macros.h"
#include "core/features/feature_stage.h"

namespace pepeseg {

absl::StatusOr<FeatureField> TrainFeatures(Backend& backend, const Capture& capture,
                                           const Gaussians& gaussians,
                                           const FeatureOptions& options, ProgressFn progress) {
  ASSIGN_OR_RETURN(const auto stage, FeatureStage::Create(backend, capture, gaussians, options));
  return FinishFeatures(*stage, progress);
}

}  // namespace pepeseg
