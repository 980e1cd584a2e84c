#pragma once

#include "core/reconstruct/options.h"
#include "core/scene/capture.h"

namespace pepeseg {

// Largest coarse_until that a limit on pixels leads to. The last steps must see photographs at
// full size: Gaussians that have only seen half of it are too thin there
// (tests/bench/results/preview_cpu.md).
inline constexpr double kMaxCoarseUntil = 0.95;

// Captures of more training views than this are trained on as real_size.md measured: see
// WithFewVisits. With fewer, raised rates cost the borders of small parts
// (tests/bench/results/real_size.md).
inline constexpr double kManyViews = 100;

// Training views, and the mean of their pixels.
struct ViewPixels {
  double num_views = 0, pixels = 0;
};
ViewPixels TrainingViewPixels(const Capture& capture);

// Returns the megapixels that a step renders on average.
double MegapixelsPerStep(const ReconstructOptions& options, const ViewPixels& views);

// Returns the options with coarse_until raised until steps render at most megapixels_per_step on
// average, but only as far as full_size_visits and kMaxCoarseUntil allow (on more than kManyViews
// views full_size_visits always allows a half), and with pixels_per_gaussian raised with it, by up
// to 4: a photograph at half of its size has a quarter of the pixels. Unchanged where
// megapixels_per_step is 0 or the steps have fewer pixels.
ReconstructOptions WithPixelBudget(ReconstructOptions options, const ViewPixels& views);

}  // namespace pepeseg
