#include "core/reconstruct/morton_order.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace pepeseg {
namespace {

using ::testing::ElementsAre;

TEST(MortonOrder, WalksTheCornersOfACube) {
  // Point i is the corner with the bits of 7 - i: x lowest.
  std::vector<float> means(24);
  for (int i = 0; i < 8; ++i) {
    for (int axis = 0; axis < 3; ++axis) means[8 * axis + i] = float((7 - i) >> axis & 1);
  }
  EXPECT_THAT(MortonOrder(means), ElementsAre(7, 6, 5, 4, 3, 2, 1, 0));
}

TEST(MortonOrder, KeepsEqualPointsInOrder) {
  EXPECT_THAT(MortonOrder(std::vector<float>(9, 0.5f)), ElementsAre(0, 1, 2));
  EXPECT_TRUE(MortonOrder({}).empty());
}

TEST(MortonOrder, IsAPermutationEvenOfMeansThatAreNotFinite) {
  const float nan = std::nanf(""), inf = std::numeric_limits<float>::infinity();
  const std::vector<float> means = {1, nan, 0, inf, 0, 0, 1, 2, 3, 4, 5, 6};
  auto order = MortonOrder(means);
  EXPECT_THAT(order, ::testing::UnorderedElementsAre(0, 1, 2, 3));
}

}  // namespace
}  // namespace pepeseg
