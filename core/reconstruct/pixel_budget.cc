#include "core/reconstruct/pixel_budget.h"

#include <algorithm>
#include <cmath>

namespace pepeseg {
namespace {

// Share of a photograph's pixels that the steps before coarse_until render on average: half of them
// a sixteenth, half of them a quarter (Schedule::ShrinkAt).
constexpr double kCoarseShare = (1.0 / 16 + 1.0 / 4) / 2;

}  // namespace

ReconstructOptions WithPixelBudget(ReconstructOptions options, double view_pixels) {
  const double before = options.coarse_until;
  if (options.max_megapixels <= 0 || view_pixels <= 0 || before >= kMaxCoarseUntil) return options;
  const double all = options.num_steps * view_pixels;  // pixels without coarse steps
  const double needed = (1 - 1e6 * options.max_megapixels / all) / (1 - kCoarseShare);
  options.coarse_until = std::clamp(needed, before, kMaxCoarseUntil);
  const double raised = (options.coarse_until - before) / (1 - before);
  options.pixels_per_gaussian *= std::pow(4, raised);
  return options;
}

ReconstructOptions WithPixelBudget(const ReconstructOptions& options, const Capture& capture) {
  double pixels = 0, num_views = 0;
  for (const View& view : capture.views) {
    if (view.held_out) continue;
    pixels += static_cast<double>(view.camera.width) * view.camera.height;
    ++num_views;
  }
  return WithPixelBudget(options, num_views > 0 ? pixels / num_views : 0);
}

}  // namespace pepeseg
