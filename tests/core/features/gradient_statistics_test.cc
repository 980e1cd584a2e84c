#include "core/features/gradient_statistics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <limits>
#include <random>
#include <vector>

namespace pepeseg {
namespace {

TEST(Spread, AddsOneDeviationToTheMean) {
  Spread spread;
  EXPECT_EQ(spread.OneAboveMean(), 0);
  for (const float x : {1.0f, 3.0f}) spread.Add(x);
  EXPECT_FLOAT_EQ(spread.OneAboveMean(), 3);  // 2 + 1
}

TEST(WindowSums, HaveTheSpreadOfEachWindow) {
  constexpr int kWidth = 13, kHeight = 7;
  std::mt19937 random(1);
  std::uniform_real_distribution<float> value(0, 1);
  std::vector<float> gradients(kWidth * kHeight);
  for (float& gradient : gradients) gradient = value(random);
  gradients[2] = gradients[40] = std::numeric_limits<float>::quiet_NaN();
  const WindowSums sums(kWidth, kHeight, [&](int64_t i) { return gradients[i]; });
  for (const int radius : {0, 1, 3, 20}) {
    for (int pixel = 0; pixel < kWidth * kHeight; ++pixel) {
      Spread spread;
      for (int i = 0; i < kWidth * kHeight; ++i) {
        const bool inside = std::abs(i % kWidth - pixel % kWidth) <= radius &&
                            std::abs(i / kWidth - pixel / kWidth) <= radius;
        if (inside && !std::isnan(gradients[i])) spread.Add(gradients[i]);
      }
      EXPECT_NEAR(sums.OneAboveMean(pixel, radius), spread.OneAboveMean(), 1e-3) << pixel;
    }
  }
}

TEST(GradientAt, TakesTheDifferenceBeforeAtTheLastColumnAndScanline) {
  constexpr int kWidth = 3, kHeight = 2;
  const std::vector<float> values = {0, 3, 7, 4, 7, 11};
  const auto difference = [&](int64_t a, int64_t b) { return values[a] - values[b]; };
  EXPECT_FLOAT_EQ(GradientAt(0, kWidth, kHeight, difference), 5);                 // 3 and 4
  EXPECT_FLOAT_EQ(GradientAt(2, kWidth, kHeight, difference), std::hypot(4, 4));  // 7 - 3, 7 - 11
  EXPECT_FLOAT_EQ(GradientAt(5, kWidth, kHeight, difference), std::hypot(4, 4));  // 11 - 7, 11 - 7
  EXPECT_FLOAT_EQ(GradientAt(0, 1, 1, [](int64_t, int64_t) { return 0; }), 0);
}

}  // namespace
}  // namespace pepeseg
