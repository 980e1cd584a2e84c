#include "core/scene/model.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

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

// The query for the mean has the same cosines as the mean itself, at a gate that weighs some
// numbers a thousand times as much as others.
TEST(GatedMean, PointsWhereTheMeanOfGatedUnitsDoes) {
  constexpr size_t kSize = 32;
  std::vector<float> gate(2 * kSize), features(3 * kSize);
  for (size_t k = 0; k < kSize; ++k) {
    gate[k] = static_cast<float>(k % 3) * 4 - 4;
    gate[kSize + k] = static_cast<float>(k % 5) - 3;
  }
  for (size_t i = 0; i < features.size(); ++i) features[i] = static_cast<float>(i * i % 17) - 8;
  const std::vector<float> units = GatedUnits(features, gate, 0.7f);
  std::vector<double> mean(kSize);
  for (size_t i = 0; i < units.size(); ++i) mean[i % kSize] += units[i];
  double squares = 0;
  for (const double value : mean) squares += value * value;
  const std::vector<float> back = GatedUnits(GatedMean(features, gate, 0.7f), gate, 0.7f);
  ASSERT_EQ(back.size(), kSize);
  for (size_t k = 0; k < kSize; ++k) EXPECT_NEAR(back[k], mean[k] / std::sqrt(squares), 1e-6);
}

TEST(GatedMean, IsZeroOfNothing) {
  const std::vector<float> gate(64);
  EXPECT_EQ(GatedMean({}, gate, 0.5f), std::vector<float>(32));
  EXPECT_EQ(GatedMean(std::vector<float>(64), gate, 0.5f), std::vector<float>(32));
}

}  // namespace
}  // namespace pepeseg
