#include "kernels/half.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace pepeseg {
namespace {

TEST(Half, RoundTripsEveryValue) {
  for (int bits = 0; bits < 0x10000; ++bits) {
    const float value = FloatFromHalf(Half{static_cast<uint16_t>(bits)});
    if (std::isnan(value)) {
      // NaN has many bit patterns, which need not survive.
      EXPECT_TRUE(std::isnan(FloatFromHalf(HalfFromFloat(value))));
    } else {
      EXPECT_EQ(HalfFromFloat(value).bits, bits) << value;
    }
  }
}

TEST(Half, MatchesKnownValues) {
  EXPECT_EQ(FloatFromHalf(Half{0x3C00}), 1.0f);
  EXPECT_EQ(FloatFromHalf(Half{0xC000}), -2.0f);
  EXPECT_EQ(FloatFromHalf(Half{0x7BFF}), 65504.0f);
  EXPECT_EQ(FloatFromHalf(Half{0x0001}), 0x1p-24f);
  EXPECT_EQ(HalfFromFloat(65520.0f).bits, 0x7C00);
  EXPECT_EQ(HalfFromFloat(1e30f).bits, 0x7C00);
  EXPECT_EQ(HalfFromFloat(-std::numeric_limits<float>::infinity()).bits, 0xFC00);
}

TEST(Half, RoundsToTheNearestAndTiesToEven) {
  EXPECT_EQ(HalfFromFloat(1.0f + 0x1p-11f).bits, 0x3C00);
  EXPECT_EQ(HalfFromFloat(1.0f + 3 * 0x1p-11f).bits, 0x3C02);
  EXPECT_EQ(HalfFromFloat(1.0f + 0x1p-11f + 0x1p-20f).bits, 0x3C01);
  EXPECT_EQ(HalfFromFloat(0x1p-25f).bits, 0x0000);
  EXPECT_EQ(HalfFromFloat(3 * 0x1p-25f).bits, 0x0002);
  EXPECT_EQ(HalfFromFloat(-0x1p-26f).bits, 0x8000);
}

}  // namespace
}  // namespace pepeseg
