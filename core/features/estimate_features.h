#pragma once

#include <cstdint>

#include "core/features/train_features.h"
#include "kernels/backend.h"

namespace pepeseg {

// Bounds what stage two allocates of the backend's memory for Gaussians of this degree, whose
// renders take `scratch`. Rows are taken to be no longer than kTypicalRow.
int64_t FeatureDeviceBytes(const Backend& backend, const ScratchSize& scratch, int sh_degree,
                           const FeatureOptions& options);

// Beside it, on the host: the samples of a chunk, the model and what is computed of it.
int64_t FeatureHostBytes(const ScratchSize& scratch, int sh_degree, const FeatureOptions& options);

// Gaussians that are blended into a pixel; a median of 30 to 40 was seen.
inline constexpr int64_t kTypicalRow = 48;

}  // namespace pepeseg
