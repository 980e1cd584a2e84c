#pragma once

#include "absl/status/statusor.h"
#include "core/base/progress.h"
#include "core/features/options.h"
#include "core/scene/capture.h"
#include "core/scene/gaussians.h"
#include "core/scene/model.h"
#include "kernels/backend.h"

namespace pepeseg {

// Runs stage two from start to end. Errors are those of FeatureStage::Create and Advance, and that
// of `progress`, which is called for each step.
absl::StatusOr<FeatureField> TrainFeatures(Backend& backend, const Capture& capture,
                                           const Gaussians& gaussians,
                                           const FeatureOptions& options, ProgressFn progress);

}  // namespace pepeseg
