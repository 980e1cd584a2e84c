#pragma once

#include <cstdint>

#include "core/features/options.h"
#include "kernels/backend.h"

namespace pepeseg {

// Returns an upper bound of the backend memory of stage two, bytes. scratch: the size of a render
// of the largest view. sh_degree: of the Gaussians. It holds while blend rows have at most
// kTypicalRow entries on average.
int64_t FeatureDeviceBytes(const Backend& backend, const ScratchSize& scratch, int sh_degree,
                           const FeatureOptions& options);

// Returns the same for a number of Gaussians whose sizes are typical for views of max_pixels.
int64_t TypicalFeatureDeviceBytes(const Backend& backend, int64_t num_gaussians, int64_t max_pixels,
                                  int sh_degree, const FeatureOptions& options);

// Returns what stage two takes of host memory next to the capture, bytes: the samples of a chunk,
// the model, the features, and the pixels of a shrunk view.
int64_t FeatureHostBytes(const ScratchSize& scratch, int sh_degree, const FeatureOptions& options);

// Number of Gaussians that are assumed to be blended into a pixel. Medians of 30 to 40 were
// measured.
inline constexpr int64_t kTypicalRow = 48;

}  // namespace pepeseg
