#include "core/evaluate/adjusted_rand.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace pepeseg {
namespace {

double Ari(const std::vector<int32_t>& a, const std::vector<int32_t>& b) {
  EXPECT_EQ(AdjustedRand(a, b), AdjustedRand(b, a));
  return AdjustedRand(a, b);
}

TEST(AdjustedRand, MatchesValuesByHand) {
  // Pairs together in both 2, in a 6, in b 3, of 15: (2 - 1.2) / (4.5 - 1.2).
  EXPECT_NEAR(Ari({1, 1, 1, 2, 2, 2}, {1, 1, 2, 2, 3, 3}), 0.8 / 3.3, 1e-12);
  // 0, 2, 2, of 6: (0 - 2/3) / (2 - 2/3).
  EXPECT_NEAR(Ari({1, 1, 2, 2}, {1, 2, 1, 2}), -0.5, 1e-12);
  // All in one piece agrees with nothing beyond chance.
  EXPECT_NEAR(Ari({1, 1, 1, 1}, {1, 1, 2, 2}), 0, 1e-12);
}

TEST(AdjustedRand, IgnoresWhatTheIdsAre) {
  EXPECT_EQ(Ari({0, 0, 7, 7, 3}, {-5, -5, 2, 2, 0}), 1);
  EXPECT_EQ(Ari({4, 4, 4}, {9, 9, 9}), 1);
  EXPECT_EQ(Ari({1, 2, 3}, {3, 1, 2}), 1);
  EXPECT_EQ(Ari({}, {}), 1);
}

TEST(AdjustedRand, IsAboutZeroForIndependentIds) {
  std::mt19937 random(3);
  std::vector<int32_t> a, b;
  for (int i = 0; i < 20'000; ++i) {
    a.push_back(static_cast<int32_t>(random() % 5));
    b.push_back(static_cast<int32_t>(random() % 7));
  }
  EXPECT_NEAR(Ari(a, b), 0, 0.005);
}

}  // namespace
}  // namespace pepeseg
