#include "core/base/order_statistics.h"

#include <gtest/gtest.h>

#include <vector>

namespace pepeseg {
namespace {

TEST(OrderStatistics, TakesTheLargerOfTwoValuesInTheMiddle) {
  std::vector<double> odd = {3, 1, 2}, even = {4, 1, 3, 2}, one = {5};
  EXPECT_EQ(UpperMedian(odd), 2);
  EXPECT_EQ(UpperMedian(even), 3);
  EXPECT_EQ(UpperMedian(one), 5);
}

TEST(OrderStatistics, CountsRanksFromZero) {
  std::vector<int> values = {3, 1, 2};
  EXPECT_EQ(ValueAtRank(values, 0), 1);
  EXPECT_EQ(ValueAtRank(values, 2), 3);
}

TEST(OrderStatistics, TakesTheValueAtTheNearestRank) {
  std::vector<float> values = {40, 0, 30, 10, 20};  // ranks 0 to 4
  EXPECT_EQ(NearestRank(values, 0), 0);
  EXPECT_EQ(NearestRank(values, 1), 40);
  EXPECT_EQ(NearestRank(values, 0.3), 10);   // 1.2
  EXPECT_EQ(NearestRank(values, 0.45), 20);  // 1.8
}

}  // namespace
}  // namespace pepeseg
