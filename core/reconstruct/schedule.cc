#include "core/reconstruct/schedule.h"

#include <algorithm>
#include <cmath>

namespace pepeseg {
namespace {

constexpr double kMostPixels = 1;  // that a mean may be moved by at the first step

}  // namespace

LearningRates Schedule::RatesAt(int step) const {
  const double start = options_.mean_learning_rate, end = options_.mean_learning_rate_final;
  LearningRates rates;
  // Through long lenses a small share of the scene's radius is many pixels: a Gaussian would never
  // come to rest on what it shows. Adam's step is about its rate.
  rates.mean = static_cast<float>(std::min(scene_radius_ * start, kMostPixels * pixel_span_) *
                                  std::pow(end / start, ShareAt(step)));
  rates.log_scale = options_.log_scale_learning_rate;
  rates.rotation = options_.rotation_learning_rate;
  rates.opacity = options_.opacity_learning_rate;
  rates.sh_dc = options_.sh_learning_rate;
  rates.sh_rest = options_.sh_learning_rate / 20;
  return rates;
}

int Schedule::ShDegreeAt(int step) const {
  constexpr double kRises = 30;  // one more band every num_steps / 30
  return std::min(options_.sh_degree, static_cast<int>(kRises * ShareAt(step)));
}

// A reversed sigmoid from depth_weight to depth_weight_final.
float Schedule::DepthWeightAt(int step) const {
  constexpr double kSteepness = 12;
  constexpr double kNegligible = 1e-4;
  const auto falling = [](double share) { return 1 / (1 + std::exp(kSteepness * (share - 0.5))); };
  const double left = (falling(ShareAt(step)) - falling(1)) / (falling(0) - falling(1));
  const double start = options_.depth_weight;
  const double end = std::min<double>(start, options_.depth_weight_final);
  const double weight = end + (start - end) * left;
  return weight < kNegligible ? 0 : static_cast<float>(weight);
}

int Schedule::ShrinkAt(int step) const {
  if (ShareAt(step) < options_.coarse_until / 2) return 4;
  return ShareAt(step) < options_.coarse_until ? 2 : 1;
}

}  // namespace pepeseg
