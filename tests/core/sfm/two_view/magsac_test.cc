#include "core/sfm/two_view/magsac.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace pepeseg {
namespace {

// The weight by its definition: the density of the noise-scaled residual without its r^3 (chi with
// four degrees of freedom), exp(-r^2 / 2 s^2) / s^4, times r^3, integrated over the noise s for
// which r is an inlier.
double IntegratedWeight(double r, double sigma_max) {
  constexpr int kSteps = 200000;
  const double begin = r / 3.64;
  double sum = 0;
  for (int i = 0; i < kSteps; ++i) {
    const double s = begin + (sigma_max - begin) * (i + 0.5) / kSteps;
    sum += std::exp(-r * r / (2 * s * s)) / (s * s * s * s) * (sigma_max - begin) / kSteps;
  }
  return sum * r * r * r;
}

TEST(MagsacLoss, WeighsByTheIntegralOverTheNoise) {
  const MagsacLoss loss(3.64);
  const double at_one = loss.Weight(1) / IntegratedWeight(1, 1);
  for (const double r : {0.3, 0.6, 1.5, 2.0, 3.0}) {
    EXPECT_NEAR(loss.Weight(r * r) / IntegratedWeight(r, 1), at_one, 0.01 * at_one) << r;
  }
}

TEST(MagsacLoss, HasTheWeightAsItsSlope) {
  const MagsacLoss loss(3);
  // d loss / d (r^2) is proportional to the weight.
  const double factor = (loss.Loss(1.5) - loss.Loss(0.5)) / loss.Weight(1);
  for (const double squared : {2.0, 3.0, 5.0, 8.0}) {
    const double slope = loss.Loss(squared + 0.5) - loss.Loss(squared - 0.5);
    EXPECT_NEAR(slope / factor, loss.Weight(squared), 0.02) << squared;
  }
}

TEST(MagsacLoss, RunsFromZeroToOne) {
  const MagsacLoss loss(3);
  EXPECT_NEAR(loss.Loss(0), 0, 0.01);
  EXPECT_NEAR(loss.Weight(0), 1, 0.01);
  EXPECT_NEAR(loss.Loss(8.999), 1, 0.01);
  for (const double beyond : {9.0, 1e300, std::numeric_limits<double>::infinity(), std::nan("")}) {
    EXPECT_EQ(loss.Loss(beyond), 1) << beyond;
    EXPECT_EQ(loss.Weight(beyond), 0) << beyond;
  }
}

}  // namespace
}  // namespace pepeseg
