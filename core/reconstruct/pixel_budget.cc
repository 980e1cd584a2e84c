#include "core/reconstruct/pixel_budget.h"

#include <algorithm>
#include <cmath>

namespace pepeseg {
namespace {

// Share of a photograph's pixels that the steps before coarse_until render on average: half of them
// a sixteenth, half of them a quarter (Schedule::ShrinkAt).
constexpr double kCoarseShare = (1.0 / 16 + 1.0 / 4) / 2;

// Where more than kManyViews photographs leave less by full_size_visits, this share of the steps
// may still be done on smaller ones (tests/bench/results/real_size.md).
constexpr double kCoarseAnyway = 0.5;

}  // namespace

double MegapixelsPerStep(const ReconstructOptions& options, const ViewPixels& views) {
  return 1e-6 * views.pixels * (1 - options.coarse_until * (1 - kCoarseShare));
}

ReconstructOptions WithPixelBudget(ReconstructOptions options, const ViewPixels& views) {
  const double before = options.coarse_until;
  if (options.megapixels_per_step <= 0 || views.pixels <= 0) return options;
  const double needed = (1 - 1e6 * options.megapixels_per_step / views.pixels) / (1 - kCoarseShare);
  const double visits = options.full_size_visits * views.num_views;
  const double least = views.num_views > kManyViews ? kCoarseAnyway : 0;
  const double allowed = std::clamp(1 - visits / options.num_steps, least, kMaxCoarseUntil);
  options.coarse_until = std::max(before, std::min(needed, allowed));
  if (options.coarse_until == before) return options;
  const double raised = (options.coarse_until - before) / (1 - before);
  options.pixels_per_gaussian *= std::pow(4, raised);
  return options;
}

ViewPixels TrainingViewPixels(const Capture& capture) {
  ViewPixels views;
  for (const View& view : capture.views) {
    if (view.held_out) continue;
    views.pixels += static_cast<double>(view.camera.width) * view.camera.height;
    ++views.num_views;
  }
  if (views.num_views > 0) views.pixels /= views.num_views;
  return views;
}

}  // namespace pepeseg
