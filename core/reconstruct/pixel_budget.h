#pragma once

#include "core/reconstruct/options.h"
#include "core/scene/capture.h"

namespace pepeseg {

// Largest coarse_until that a budget of pixels leads to. The last steps must see photographs at
// full size: Gaussians that have only seen half of it are too thin there
// (tests/bench/results/preview_cpu.md).
inline constexpr double kMaxCoarseUntil = 0.95;

// Returns the options with coarse_until raised until all steps together render at most
// options.max_megapixels, but not over kMaxCoarseUntil, and with pixels_per_gaussian raised with
// it, by up to 4: a photograph at half of its size has a quarter of the pixels. Unchanged where
// max_megapixels is 0 or the steps have fewer pixels. view_pixels: mean pixels of a training view.
ReconstructOptions WithPixelBudget(ReconstructOptions options, double view_pixels);
// The same for the training views of a capture.
ReconstructOptions WithPixelBudget(const ReconstructOptions& options, const Capture& capture);

}  // namespace pepeseg
