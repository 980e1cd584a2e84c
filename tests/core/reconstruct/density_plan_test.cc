#include "core/reconstruct/density_plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "kernels/gaussian_planes.h"

namespace pepeseg {
namespace {

struct Blob {
  float x;          // the mean is (x, 0, 0)
  float deviation;  // isotropic
  float opacity;
  float mean_gradient;
};

DensityInput Input(const std::vector<Blob>& blobs) {
  DensityInput input;
  input.count = static_cast<int64_t>(blobs.size());
  input.planes.assign((kOpacityPlane + 1) * blobs.size(), 0);
  for (size_t i = 0; i < blobs.size(); ++i) {
    const Blob& blob = blobs[i];
    input.planes[kMeanPlane * blobs.size() + i] = blob.x;
    for (int axis = 0; axis < 3; ++axis) {
      input.planes[(kLogScalePlane + axis) * blobs.size() + i] = std::log(blob.deviation);
    }
    input.planes[kRotationPlane * blobs.size() + i] = 1;
    input.planes[kOpacityPlane * blobs.size() + i] = std::log(blob.opacity / (1 - blob.opacity));
    input.num_visible.push_back(4);
    input.grad_sum.push_back(4 * blob.mean_gradient);
  }
  return input;
}

constexpr DensityRules kRules = {
    .gradient = 1e-3f, .clone_size = 0.1f, .min_opacity = 0.01f, .max_count = 100};

int CountOf(const DensityPlan& plan, int32_t source) {
  return static_cast<int>(std::count(plan.source.begin(), plan.source.end(), source));
}

TEST(DensityPlan, LeavesQuietGaussiansAlone) {
  std::mt19937_64 random(1);
  const DensityPlan plan =
      PlanDensity(Input({{0, 0.05f, 0.5f, 9e-4f}, {1, 0.5f, 0.5f, 0}}), kRules, random);
  EXPECT_THAT(plan.source, ::testing::ElementsAre(0, 1));
  EXPECT_THAT(plan.is_new, ::testing::ElementsAre(0, 0));
  EXPECT_EQ(plan.num_cloned + plan.num_split + plan.num_pruned, 0);
}

TEST(DensityPlan, ClonesASmallGaussianInPlace) {
  std::mt19937_64 random(1);
  const DensityPlan plan = PlanDensity(Input({{2, 0.05f, 0.5f, 2e-3f}}), kRules, random);
  EXPECT_EQ(plan.num_cloned, 1);
  ASSERT_THAT(plan.source, ::testing::ElementsAre(0, 0));
  EXPECT_THAT(plan.is_new, ::testing::ElementsAre(0, 1));  // the first one keeps its moments
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(plan.mean_and_log_scale[i], 2.0f);
    EXPECT_EQ(plan.mean_and_log_scale[2 * 3 + i], std::log(0.05f));
  }
}

TEST(DensityPlan, SplitsALargeGaussianIntoTwoSmallerOnes) {
  std::mt19937_64 random(1);
  const DensityPlan plan = PlanDensity(Input({{2, 0.2f, 0.5f, 2e-3f}}), kRules, random);
  EXPECT_EQ(plan.num_split, 1);
  ASSERT_THAT(plan.source, ::testing::ElementsAre(0, 0));
  EXPECT_THAT(plan.is_new, ::testing::ElementsAre(1, 1));
  EXPECT_NE(plan.mean_and_log_scale[0], plan.mean_and_log_scale[1]);
  for (int i = 0; i < 2; ++i) {
    EXPECT_NEAR(plan.mean_and_log_scale[i], 2, 5 * 0.2);
    EXPECT_FLOAT_EQ(plan.mean_and_log_scale[2 * 3 + i], std::log(0.2f / 1.6f));
  }
}

TEST(DensityPlan, DrawsChildrenWithTheParentsCovariance) {
  // Long along its own x axis, which a quarter turn about z puts along the world's y.
  DensityInput input = Input({{0, 0.2f, 0.5f, 2e-3f}});
  input.planes[kLogScalePlane] = std::log(3.0f);
  input.planes[kRotationPlane] = std::sqrt(0.5f);
  input.planes[kRotationPlane + 3] = std::sqrt(0.5f);
  std::mt19937_64 random(1);
  double sum_xx = 0, sum_yy = 0;
  constexpr int kRounds = 4000;
  for (int i = 0; i < kRounds; ++i) {
    const DensityPlan plan = PlanDensity(input, kRules, random);
    sum_xx += std::pow(plan.mean_and_log_scale[0], 2);
    sum_yy += std::pow(plan.mean_and_log_scale[2], 2);
  }
  EXPECT_NEAR(std::sqrt(sum_xx / kRounds), 0.2, 0.2 * 0.06);
  EXPECT_NEAR(std::sqrt(sum_yy / kRounds), 3.0, 3.0 * 0.06);
}

TEST(DensityPlan, PrunesTheFaintEvenWithALargeGradient) {
  std::mt19937_64 random(1);
  const DensityPlan plan = PlanDensity(
      Input({{0, 0.05f, 0.005f, 1}, {1, 0.05f, 0.02f, 0}, {2, 0.2f, 0.009f, 1}}), kRules, random);
  EXPECT_EQ(plan.num_pruned, 2);
  EXPECT_THAT(plan.source, ::testing::ElementsAre(1));
}

TEST(DensityPlan, NeverSeenMeansNoGradient) {
  DensityInput input = Input({{0, 0.05f, 0.5f, 1}});
  input.num_visible[0] = 0;
  std::mt19937_64 random(1);
  EXPECT_EQ(PlanDensity(input, kRules, random).source.size(), 1u);
}

TEST(DensityPlan, RespectsTheCapAndPrefersLargeGradients) {
  std::mt19937_64 random(1);
  const DensityInput input = Input({{0, 0.05f, 0.5f, 2e-3f},
                                    {1, 0.05f, 0.5f, 8e-3f},
                                    {2, 0.5f, 0.5f, 4e-3f},
                                    {3, 0.05f, 0.5f, 1e-3f}});
  DensityRules rules = kRules;
  rules.max_count = 6;
  const DensityPlan plan = PlanDensity(input, rules, random);
  EXPECT_EQ(plan.source.size(), 6u);
  EXPECT_EQ(CountOf(plan, 0), 1);
  EXPECT_EQ(CountOf(plan, 1), 2);
  EXPECT_EQ(CountOf(plan, 2), 2);
  EXPECT_EQ(CountOf(plan, 3), 1);
  rules.max_count = 2;  // already over it: nothing is added, nothing bright is lost
  EXPECT_EQ(PlanDensity(input, rules, random).source.size(), 4u);
}

TEST(DensityPlan, OrdersRowsAlongTheMortonCurve) {
  std::mt19937_64 random(1);
  const DensityPlan plan = PlanDensity(
      Input({{3, 0.05f, 0.5f, 0}, {1, 0.05f, 0.5f, 0}, {2, 0.05f, 0.5f, 0}}), kRules, random);
  EXPECT_THAT(plan.source, ::testing::ElementsAre(1, 2, 0));
  EXPECT_FLOAT_EQ(plan.mean_and_log_scale[0], 1);
}

}  // namespace
}  // namespace pepeseg
