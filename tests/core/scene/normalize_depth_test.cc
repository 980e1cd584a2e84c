#include "core/scene/normalize_depth.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <numeric>

namespace pepeseg {
namespace {

using ::testing::IsNan;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

TEST(NormalizeDepth, MapsPercentilesAndClampsBeyond) {
  std::vector<float> values(2001);
  std::iota(values.begin(), values.end(), 100.0f);
  values[0] = -1e6f;
  values[2000] = 1e9f;
  values.push_back(kNan);
  const std::vector<float> normal = NormalizeDepth(values);
  ASSERT_EQ(normal.size(), values.size());
  EXPECT_EQ(normal[0], 0);
  EXPECT_EQ(normal[2], 0);  // the 0.1 percentile of 2001 values is the third
  EXPECT_EQ(normal[1998], 1);
  EXPECT_EQ(normal[2000], 1);
  EXPECT_FLOAT_EQ(normal[1000], 0.5f);
  EXPECT_THAT(normal[2001], IsNan());
}

TEST(NormalizeDepth, OfOneValueOrNoneIsEmpty) {
  EXPECT_THAT(NormalizeDepth({3, 3, kNan, 3}), ::testing::IsEmpty());
  EXPECT_THAT(NormalizeDepth({kNan, kNan}), ::testing::IsEmpty());
  // One odd pixel in 2,000 lies beyond the percentiles.
  std::vector<float> values(2000, 7.0f);
  values[5] = 8;
  EXPECT_THAT(NormalizeDepth(values), ::testing::IsEmpty());
}

}  // namespace
}  // namespace pepeseg
