#include "core/reconstruct/few_visits.h"

#include <algorithm>
#include <cmath>

namespace pepeseg {
namespace {

// Share of few_visits from which on the changes are whole.
constexpr double kFewest = 1.0 / 3;

// The whole changes, measured in tests/bench/results/real_size.md.
constexpr double kMoreMeanRate = 2;
constexpr double kMoreRate = 3;         // of log scales and colours
constexpr double kLessGradient = 0.25;  // from which a Gaussian is densified
constexpr double kFasterDecay = 10;     // of the second moments of Adam

}  // namespace

ReconstructOptions WithFewVisits(ReconstructOptions options, const ViewPixels& views) {
  const double visits = options.num_steps / std::max(1.0, views.num_views);
  if (views.num_views <= kManyViews || visits >= options.few_visits) return options;
  const double share = std::min(1.0, std::log(visits / options.few_visits) / std::log(kFewest));
  const auto factor = [share](double whole) { return static_cast<float>(std::pow(whole, share)); };
  options.mean_learning_rate *= factor(kMoreMeanRate);
  options.mean_learning_rate_final *= factor(kMoreMeanRate);
  options.log_scale_learning_rate *= factor(kMoreRate);
  options.sh_learning_rate *= factor(kMoreRate);
  options.densify_gradient *= factor(kLessGradient);
  options.second_moment_decay = 1 - (1 - options.second_moment_decay) * factor(kFasterDecay);
  options.dropout *= static_cast<float>(1 - share);
  const double megapixels = MegapixelsPerStep(options, views);
  if (visits < options.few_visits / 2 && options.coarse_until < kMaxCoarseUntil &&
      options.megapixels_per_step > 0 && megapixels > 0) {
    const double left =
        std::clamp(options.megapixels_per_step / megapixels, options.few_visits_steps, 1.0);
    options.num_steps = static_cast<int>(std::lround(left * options.num_steps));
  }
  return options;
}

}  // namespace pepeseg
