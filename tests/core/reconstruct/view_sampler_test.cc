#include "core/reconstruct/view_sampler.h"

#include <gtest/gtest.h>

#include <set>
#include <vector>

namespace pepeseg {
namespace {

TEST(ViewSampler, ShowsEachViewOnceARound) {
  ViewSampler sampler(7);
  std::mt19937_64 random(3);
  std::vector<int> first_round;
  for (int round = 0; round < 5; ++round) {
    std::vector<int> shown(7);
    for (int& view : shown) view = sampler.Next(random);
    EXPECT_EQ(std::set<int>(shown.begin(), shown.end()), (std::set<int>{0, 1, 2, 3, 4, 5, 6}));
    if (round == 0) first_round = shown;
    if (round == 4) {
      EXPECT_NE(shown, first_round);
    }
  }
}

TEST(ViewSampler, RepeatsWithTheSeed) {
  ViewSampler a(20), b(20), c(20);
  std::mt19937_64 random_a(1), random_b(1), random_c(2);
  bool differs = false;
  for (int i = 0; i < 60; ++i) {
    const int view = a.Next(random_a);
    EXPECT_EQ(view, b.Next(random_b));
    differs = differs || view != c.Next(random_c);
  }
  EXPECT_TRUE(differs);
}

}  // namespace
}  // namespace pepeseg
