#include "core/sfm/two_view/magsac.h"

#include <cmath>
#include <numbers>

namespace pepeseg {
namespace {

constexpr double kQuantile = 3.64;  // 0.99 quantile of the chi distribution with four degrees

// Returns the upper incomplete gamma function of 3/2 in closed form.
double UpperGamma(double x) {
  return std::sqrt(x) * std::exp(-x) + std::sqrt(std::numbers::pi) / 2 * std::erfc(std::sqrt(x));
}

// Returns the lower incomplete gamma function of 5/2 by its recurrence from 3/2.
double LowerGamma(double x) {
  const double lower = std::sqrt(std::numbers::pi) / 2 - UpperGamma(x);
  return 1.5 * lower - x * std::sqrt(x) * std::exp(-x);
}

// Returns the weight at r = sqrt(2 x) sigma_max, up to a factor.
double WeightAt(double x) { return UpperGamma(x) - UpperGamma(kQuantile * kQuantile / 2); }

// Returns the integral of r times the weight from 0 to r, up to the same factor, with
// sigma_max = 1 (equation 7).
double LossAt(double x) { return LowerGamma(x) + x * WeightAt(x); }

}  // namespace

MagsacLoss::MagsacLoss(double limit) : limit_(limit), steps_per_unit_(kSteps / (limit * limit)) {
  constexpr double kEnd = kQuantile * kQuantile / 2;
  for (int i = 0; i < kSteps; ++i) {
    const double x = kEnd * (i + 0.5) / kSteps;
    loss_[i] = static_cast<float>(LossAt(x) / LossAt(kEnd));
    weight_[i] = static_cast<float>(WeightAt(x) / WeightAt(0));
  }
}

}  // namespace pepeseg
