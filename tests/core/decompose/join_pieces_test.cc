#include "core/decompose/join_pieces.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace pepeseg {
namespace {

// Returns directions in a plane, [n, 32]. rays: angle in degrees, and length.
std::vector<float> Fan(const std::vector<std::pair<double, double>>& rays) {
  std::vector<float> sums;
  for (const auto& [degrees, length] : rays) {
    const double angle = degrees * M_PI / 180;
    std::vector<float> sum(32);
    sum[0] = static_cast<float>(length * std::cos(angle));
    sum[5] = static_cast<float>(length * std::sin(angle));
    sums.insert(sums.end(), sum.begin(), sum.end());
  }
  return sums;
}

const double kCosine20 = std::cos(20 * M_PI / 180);

TEST(JoinPieces, JoinsCloseDirections) {
  EXPECT_EQ(JoinPieces(Fan({{0, 1}, {90, 1}, {10, 1}, {95, 2}, {180, 1}}), kCosine20),
            (std::vector<int32_t>{0, 1, 0, 1, 2}));
  EXPECT_EQ(JoinPieces(Fan({{0, 1}, {10, 1}}), 1), (std::vector<int32_t>{0, 1}));
  EXPECT_TRUE(JoinPieces({}, 0.5).empty());
}

TEST(JoinPieces, JoinsTheClosestFirstAndWeighsByLength) {
  // 15 and 29 degrees are joined first, at 22 degrees: too far from 0.
  EXPECT_EQ(JoinPieces(Fan({{0, 1}, {15, 1}, {29, 1}}), kCosine20),
            (std::vector<int32_t>{0, 1, 1}));
  EXPECT_EQ(JoinPieces(Fan({{0, 1}, {14, 100}, {33, 1}}), kCosine20),
            (std::vector<int32_t>{0, 0, 0}))
      << "the heavy piece keeps its direction";
  EXPECT_EQ(JoinPieces(Fan({{0, 100}, {14, 1}, {33, 1}}), kCosine20),
            (std::vector<int32_t>{0, 0, 1}));
}

TEST(JoinPieces, NeverJoinsZeros) {
  EXPECT_EQ(JoinPieces(Fan({{0, 0}, {0, 1}, {0, 0}, {0, 2}}), -1),
            (std::vector<int32_t>{0, 1, 2, 1}));
}

// Joins one pair at a time and computes all cosines again each time.
std::vector<int32_t> JoinNaively(std::vector<float> sums, double join_cosine) {
  const size_t count = sums.size() / 32;
  std::vector<int32_t> to(count);
  for (size_t i = 0; i < count; ++i) to[i] = static_cast<int32_t>(i);
  for (;;) {
    double best = join_cosine;
    size_t best_a = 0, best_b = 0;
    for (size_t a = 0; a < count; ++a) {
      for (size_t b = a + 1; b < count; ++b) {
        if (to[a] != static_cast<int32_t>(a) || to[b] != static_cast<int32_t>(b)) continue;
        double ab = 0, aa = 0, bb = 0;
        for (int k = 0; k < 32; ++k) {
          const double x = sums[32 * a + k], y = sums[32 * b + k];
          ab += x * y, aa += x * x, bb += y * y;
        }
        const double cosine = ab / std::sqrt(aa * bb);
        if (cosine > best) best = cosine, best_a = a, best_b = b;
      }
    }
    if (best_b == 0) return to;
    for (int k = 0; k < 32; ++k) sums[32 * best_a + k] += sums[32 * best_b + k];
    for (int32_t& target : to) {
      if (target == static_cast<int32_t>(best_b)) target = static_cast<int32_t>(best_a);
    }
  }
}

TEST(JoinPieces, AgreesWithANaiveImplementation) {
  std::mt19937 random(8);
  std::normal_distribution<float> normal;
  for (int round = 0; round < 5; ++round) {
    std::vector<float> sums(32 * 40);
    for (size_t i = 0; i < sums.size(); ++i) {
      sums[i] = normal(random) + (i % 32 == 0 ? 4.0f : 0.0f);
    }
    const std::vector<int32_t> got = JoinPieces(sums, 0.6), want = JoinNaively(sums, 0.6);
    for (size_t a = 0; a < got.size(); ++a) {
      for (size_t b = 0; b < a; ++b) EXPECT_EQ(got[a] == got[b], want[a] == want[b]);
    }
    EXPECT_NE(got, JoinPieces(sums, 0.99)) << "something was joined";
  }
}

}  // namespace
}  // namespace pepeseg
