#pragma once

#include <cstdint>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/progress.h"
#include "core/scene/capture.h"
#include "core/scene/gaussians.h"
#include "core/scene/model.h"
#include "kernels/backend.h"

namespace pepeseg {

// Stage two (method.md sections 2 and 3): geometry frozen.
struct FeatureOptions {
  int num_steps = 10000;  // one view each
  int num_pixels = 1000;  // samples a step, each with at least one mask
  int num_scales = 10;
  float learning_rate = 2.5e-3f;
  int steps_per_chunk = 1000;  // samples drawn ahead: each view is rasterised once a chunk
  uint64_t seed = 1;
};
absl::Status Validate(const FeatureOptions& options);

// FAILED_PRECONDITION when no training view has a mask with a scale.
absl::StatusOr<FeatureField> TrainFeatures(Backend& backend, const Capture& capture,
                                           const Gaussians& gaussians,
                                           const FeatureOptions& options, ProgressFn progress);

}  // namespace pepeseg
