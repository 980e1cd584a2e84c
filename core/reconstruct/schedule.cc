#include "core/reconstruct/schedule.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/order_statistics.h"

namespace pepeseg {
namespace {

constexpr double kRatesLeft = 0.1;  // share of the other rates that is left at the last step

constexpr size_t kMostSpanViews = 256, kMostSpanPoints = 1024;  // samples of PixelSpan

// Returns the median depth of the points in front of the view, or 0 without any.
double DepthOfPoints(const View& view, const std::vector<ScenePoint>& points) {
  const size_t stride = (points.size() + kMostSpanPoints - 1) / kMostSpanPoints;
  std::vector<double> depths;
  for (size_t i = 0; i < points.size(); i += stride) {
    const double depth = (view.cam_from_world * points[i].position.cast<double>()).z();
    if (depth > 0) depths.push_back(depth);
  }
  return depths.empty() ? 0 : UpperMedian(depths);
}

}  // namespace

// The means' rate falls log-linearly from start to end. The other rates are constant until
// rates_fall_from; from there they fall log-linearly to a tenth, so that the noise of training on
// one view at a time fades.
LearningRates Schedule::RatesAt(int step) const {
  const double start = options_.mean_learning_rate, end = options_.mean_learning_rate_final;
  LearningRates rates;
  rates.mean = static_cast<float>(MeanRateAtStart() * std::pow(end / start, ShareAt(step)));
  const double from = options_.rates_fall_from, share = ShareAt(step);
  const double passed = share > from ? (share - from) / (1 - from) : 0;
  const auto left = static_cast<float>(std::pow(kRatesLeft, passed));
  rates.log_scale = left * options_.log_scale_learning_rate;
  rates.rotation = left * options_.rotation_learning_rate;
  rates.opacity = left * options_.opacity_learning_rate;
  rates.sh_dc = left * options_.sh_learning_rate;
  // As in 3DGS: higher degrees learn a twentieth as fast as the base colour.
  rates.sh_rest = rates.sh_dc / 20;
  return rates;
}

// One step of Adam is about as long as its rate. With a long lens a small share of the scene's
// radius spans many pixels, and a Gaussian would never come to rest on what it shows. Where all
// cameras are close together and the scene is far away, it spans next to nothing, and a Gaussian
// would never reach what it should show. Hence the bounds in spans of a pixel.
double Schedule::MeanRateAtStart() const {
  const double rate = scene_radius_ * options_.mean_learning_rate;
  if (!std::isfinite(pixel_span_)) return rate;
  const double cap = options_.mean_learning_rate_cap * pixel_span_;
  const double raised = std::max(rate, options_.mean_rate_pixels * pixel_span_);
  return cap > 0 ? std::min(raised, cap) : raised;
}

int Schedule::ShDegreeAt(int step) const {
  constexpr double kRises = 30;  // one degree more every num_steps / 30, as 3DGS (1,000 of 30,000)
  return std::min(options_.sh_degree, static_cast<int>(kRises * ShareAt(step)));
}

// A reversed sigmoid from depth_weight to depth_weight_final, scaled so that it takes both values
// exactly. Weights under kNegligible are 0, which saves the rendered depth.
float Schedule::DepthWeightAt(int step) const {
  constexpr double kSteepness = 12;
  constexpr double kNegligible = 1e-4;
  // lambda_d(t) of METHOD.md section 1. At the middle of the schedule the weight has fallen by
  // half.
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

double PixelSpan(const Capture& capture, const std::vector<ScenePoint>& points) {
  const size_t stride = (capture.views.size() + kMostSpanViews - 1) / kMostSpanViews;
  std::vector<double> spans;
  for (size_t i = 0; i < capture.views.size(); i += stride) {
    const View& view = capture.views[i];
    const double depth = DepthOfPoints(view, points);
    if (depth > 0) spans.push_back(depth / std::max(view.camera.fx, view.camera.fy));
  }
  return spans.empty() ? std::numeric_limits<double>::infinity() : UpperMedian(spans);
}

}  // namespace pepeseg
