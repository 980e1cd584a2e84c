#include "core/scene/model.h"

#include <gtest/gtest.h>

namespace pepeseg {
namespace {

TEST(ScaleQuantiles, InterpolateLinearlyBetweenKnots) {
  FeatureField field;
  field.scale_quantiles = {1, 2, 4, 8, 8};
  EXPECT_DOUBLE_EQ(QuantileOfScale(field, 3), 1.5 / 4);
  EXPECT_DOUBLE_EQ(ScaleOfQuantile(field, 1.5 / 4), 3);
  for (const double units : {1.0, 1.5, 2.0, 3.9, 7.0}) {
    EXPECT_NEAR(ScaleOfQuantile(field, QuantileOfScale(field, units)), units, 1e-12);
  }
}

TEST(ScaleQuantiles, ClampToZeroAndOne) {
  FeatureField field;
  field.scale_quantiles = {1, 2, 4, 8, 8};
  EXPECT_EQ(QuantileOfScale(field, 0.5), 0);
  EXPECT_EQ(QuantileOfScale(field, 100), 1);
  EXPECT_EQ(ScaleOfQuantile(field, -1), 1);
  EXPECT_EQ(ScaleOfQuantile(field, 2), 8);
}

TEST(ScaleQuantiles, AreZeroForAFieldWithoutScales) {
  EXPECT_EQ(QuantileOfScale({}, 3), 0);
  EXPECT_EQ(ScaleOfQuantile({}, 0.5), 0);
}

}  // namespace
}  // namespace pepeseg
