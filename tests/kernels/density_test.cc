#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "tests/kernels/backend_test.h"
#include "tests/kernels/test_scene.h"

// Density control on Gaussians whose fate can be worked out by hand.

namespace pepeseg {
namespace {

using ::testing::ElementsAre;

// A Gaussian without rotation that four views have shown.
struct Blob {
  float x;          // the mean is (x, 0, 0)
  float deviation;  // standard deviation of all axes
  float opacity;
  float mean_gradient;
};

struct Input {
  HostGaussians gaussians;
  std::vector<float> grad_sum, square_sum;
  std::vector<int32_t> num_visible;
};

// Gaussian i is blobs[i].
Input MakeInput(const std::vector<Blob>& blobs) {
  Input input;
  input.gaussians = RandomScene({.count = static_cast<int64_t>(blobs.size()), .sh_degree = 0});
  for (size_t i = 0; i < blobs.size(); ++i) {
    const auto row = static_cast<int64_t>(i);
    const Blob& blob = blobs[i];
    for (int axis = 0; axis < 3; ++axis) {
      input.gaussians.At(kMeanPlane + axis, row) = axis == 0 ? blob.x : 0;
      input.gaussians.At(kLogScalePlane + axis, row) = std::log(blob.deviation);
    }
    for (int k = 0; k < 4; ++k) input.gaussians.At(kRotationPlane + k, row) = k == 0 ? 1 : 0;
    input.gaussians.At(kOpacityPlane, row) = std::log(blob.opacity / (1 - blob.opacity));
    input.num_visible.push_back(4);
    input.grad_sum.push_back(4 * blob.mean_gradient);
    input.square_sum.push_back(1e-12f);
  }
  return input;
}

// Results of the op.
struct Plan {
  std::vector<int32_t> source;
  std::vector<uint8_t> is_new;
  std::vector<float> mean_log_scale;
  DensityCounts counts;

  float At(int plane, size_t row) const { return mean_log_scale[plane * source.size() + row]; }
  // Number of Gaussians that come from this one.
  int CountOf(int32_t row) const {
    return static_cast<int>(std::count(source.begin(), source.end(), row));
  }
};

// Numbers of PlanDensityArgs.
struct Rules {
  float min_gradient = 1e-3f;
  float clone_size = 0.1f;
  float min_opacity = 0.01f;
  int64_t max_count = 100;
  uint32_t seed = 1;
  bool draws = false;
  bool keeps_parent = false;
  float max_size = 0;
};

class PlanDensityTest : public BackendTest {
 protected:
  Plan Run(const Input& input, const Rules& rules = {}) {
    const int64_t count = input.gaussians.count;
    const Buffer<float> planes(*backend_, std::span<const float>(input.gaussians.planes));
    const Buffer<float> grad_sum(*backend_, std::span<const float>(input.grad_sum));
    const Buffer<float> square_sum(*backend_, std::span<const float>(input.square_sum));
    const Buffer<int32_t> num_visible(*backend_, std::span<const int32_t>(input.num_visible));
    Buffer<int32_t> source;
    Buffer<uint8_t> is_new;
    Buffer<float> mean_log_scale;
    Plan plan;
    backend_->PlanDensity({.gaussians = {planes.span().data, count, count, 0},
                           .mean2d_grad_sum = grad_sum.span(),
                           .square_sum = square_sum.span(),
                           .num_visible = num_visible.span(),
                           .min_gradient = rules.min_gradient,
                           .clone_size = rules.clone_size,
                           .min_opacity = rules.min_opacity,
                           .max_size = rules.max_size,
                           .max_count = rules.max_count,
                           .draws = rules.draws,
                           .keeps_parent = rules.keeps_parent,
                           .seed = rules.seed,
                           .source = &source,
                           .is_new = &is_new,
                           .mean_log_scale = &mean_log_scale,
                           .counts = &plan.counts});
    plan.source = Download(source);
    plan.is_new = Download(is_new);
    plan.mean_log_scale = Download(mean_log_scale);
    EXPECT_EQ(plan.counts.num_rows, static_cast<int64_t>(plan.source.size()));
    return plan;
  }
};
INSTANTIATE_TEST_SUITE_P(Backends, PlanDensityTest, AllBackends(), BackendName);

TEST_P(PlanDensityTest, LeavesGaussiansWithSmallGradientsAlone) {
  const Plan plan = Run(MakeInput({{0, 0.05f, 0.5f, 9e-4f}, {1, 0.5f, 0.5f, 0}}));
  EXPECT_THAT(plan.source, ElementsAre(0, 1));
  EXPECT_THAT(plan.is_new, ElementsAre(0, 0));
  EXPECT_EQ(plan.counts.num_cloned + plan.counts.num_split + plan.counts.num_pruned, 0);
}

TEST_P(PlanDensityTest, ClonesASmallGaussianInPlace) {
  const Plan plan = Run(MakeInput({{2, 0.05f, 0.5f, 2e-3f}}));
  EXPECT_EQ(plan.counts.num_cloned, 1);
  ASSERT_THAT(plan.source, ElementsAre(0, 0));
  EXPECT_THAT(plan.is_new, ElementsAre(0, 1));  // the first one keeps its moments
  for (size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(plan.At(kMeanPlane, i), 2.0f);
    EXPECT_EQ(plan.At(kLogScalePlane, i), std::log(0.05f));
  }
}

TEST_P(PlanDensityTest, SplitsALargeGaussianIntoTwoSmallerOnes) {
  const Plan plan = Run(MakeInput({{2, 0.2f, 0.5f, 2e-3f}}));
  EXPECT_EQ(plan.counts.num_split, 1);
  ASSERT_THAT(plan.source, ElementsAre(0, 0));
  EXPECT_THAT(plan.is_new, ElementsAre(1, 1));
  EXPECT_NE(plan.At(kMeanPlane, 0), plan.At(kMeanPlane, 1));
  for (size_t i = 0; i < 2; ++i) {
    EXPECT_NEAR(plan.At(kMeanPlane, i), 2, 5 * 0.2);
    EXPECT_NEAR(plan.At(kLogScalePlane, i), std::log(0.2f / 1.6f), 1e-6);
  }
}

TEST_P(PlanDensityTest, DrawsChildrenWithTheParentsCovariance) {
  // Long along its own x axis, which a quarter turn about z makes the world's y.
  constexpr int64_t kCount = 4000;
  Input input = MakeInput(std::vector<Blob>(kCount, {0, 0.2f, 0.5f, 2e-3f}));
  for (int64_t i = 0; i < kCount; ++i) {
    input.gaussians.At(kLogScalePlane, i) = std::log(3.0f);
    input.gaussians.At(kRotationPlane, i) = std::sqrt(0.5f);
    input.gaussians.At(kRotationPlane + 3, i) = std::sqrt(0.5f);
  }
  const Plan plan = Run(input, {.max_count = 2 * kCount});
  ASSERT_EQ(plan.source.size(), static_cast<size_t>(2 * kCount));
  double x = 0, y = 0, xx = 0, xy = 0, yy = 0;
  for (size_t i = 0; i < plan.source.size(); ++i) {
    const double a = plan.At(kMeanPlane, i), b = plan.At(kMeanPlane + 1, i);
    x += a, y += b, xx += a * a, xy += a * b, yy += b * b;
  }
  // Means within 4 standard errors, deviations within 4 %.
  const double num = 2 * kCount;
  EXPECT_NEAR(x / num, 0, 4 * 0.2 / std::sqrt(num));
  EXPECT_NEAR(y / num, 0, 4 * 3.0 / std::sqrt(num));
  EXPECT_NEAR(std::sqrt(xx / num), 0.2, 0.2 * 0.04);
  EXPECT_NEAR(std::sqrt(yy / num), 3.0, 3.0 * 0.04);
  EXPECT_NEAR(xy / num, 0, 4 * 0.2 * 3.0 / std::sqrt(num));
}

TEST_P(PlanDensityTest, DrawsOtherChildrenFromAnotherSeed) {
  const Input input = MakeInput({{2, 0.2f, 0.5f, 2e-3f}});
  const Plan one = Run(input), two = Run(input, {.seed = 2});
  EXPECT_EQ(one.mean_log_scale, Run(input).mean_log_scale);
  EXPECT_NE(one.mean_log_scale, two.mean_log_scale);
}

TEST_P(PlanDensityTest, PrunesTheLargeByTheSizeOfTheirChildren) {
  // Kept: as large as the limit. Pruned: larger, and not split. The third is split into children of
  // 0.25, the children of the fourth would still be too large.
  const Input input = MakeInput(
      {{0, 0.3f, 0.5f, 0}, {1, 0.31f, 0.5f, 0}, {2, 0.4f, 0.5f, 2e-3f}, {3, 0.5f, 0.5f, 2e-3f}});
  const Plan plan = Run(input, {.max_size = 0.3f});
  EXPECT_EQ(plan.counts.num_pruned, 2);
  EXPECT_EQ(plan.CountOf(0), 1);
  EXPECT_EQ(plan.CountOf(2), 2);
  EXPECT_EQ(Run(input).counts.num_pruned, 0);
}

TEST_P(PlanDensityTest, PrunesTheFaintEvenWithALargeGradient) {
  const Plan plan = Run(MakeInput(
      {{0, 0.05f, 0.005f, 1}, {1, 0.05f, 0.02f, 0}, {2, 0.2f, 0.009f, 1}, {3, 0.2f, NAN, 1}}));
  EXPECT_EQ(plan.counts.num_pruned, 3);
  EXPECT_THAT(plan.source, ElementsAre(1));
}

TEST_P(PlanDensityTest, MayLeaveNothing) {
  const Plan plan = Run(MakeInput({{0, 0.05f, 0.005f, 1}}));
  EXPECT_EQ(plan.counts.num_rows, 0);
}

TEST_P(PlanDensityTest, DoesNotDensifyAGaussianThatWasNeverSeen) {
  Input input = MakeInput({{0, 0.05f, 0.5f, 1}});
  input.num_visible[0] = 0;
  EXPECT_EQ(Run(input).source.size(), 1u);
}

TEST_P(PlanDensityTest, RespectsTheCapAndPrefersLargeGradients) {
  const Input input = MakeInput({{0, 0.05f, 0.5f, 2e-3f},
                                 {1, 0.05f, 0.5f, 8e-3f},
                                 {2, 0.5f, 0.5f, 4e-3f},
                                 {3, 0.05f, 0.5f, 4e-3f},
                                 {4, 0.05f, 0.5f, 1e-3f}});
  // Room for two more: the clone with the largest gradient, and the first of two equal ones.
  const Plan plan = Run(input, {.max_count = 7});
  EXPECT_EQ(plan.source.size(), 7u);
  for (const int32_t row : {0, 3, 4}) EXPECT_EQ(plan.CountOf(row), 1) << row;
  for (const int32_t row : {1, 2}) EXPECT_EQ(plan.CountOf(row), 2) << row;
  EXPECT_EQ(plan.counts.num_cloned, 1);
  EXPECT_EQ(plan.counts.num_split, 1);
  // With more Gaussians than max_count none is added, and none is pruned for it.
  EXPECT_EQ(Run(input, {.max_count = 2}).source.size(), 5u);
}

TEST_P(PlanDensityTest, DrawsBySquareSumsWhereThereIsNoRoomForAll) {
  // Odds of 1, 2 and 4 by turns. The mean gradients, which are the other way round, do not matter.
  constexpr int64_t kCount = 6000;
  Input input = MakeInput(std::vector<Blob>(kCount, {0, 0.05f, 0.5f, 2e-3f}));
  for (int64_t i = 0; i < kCount; ++i) {
    input.square_sum[i] *= static_cast<float>(1 << i % 3);
    input.grad_sum[i] *= static_cast<float>(3 - i % 3);
  }
  // Room for a tenth, so that no kind runs short.
  const Plan plan = Run(input, {.max_count = kCount + kCount / 10, .draws = true});
  int drawn[3] = {};
  for (int32_t i = 0; i < kCount; ++i) drawn[i % 3] += plan.CountOf(i) == 2;
  ASSERT_EQ(drawn[0] + drawn[1] + drawn[2], kCount / 10);
  EXPECT_NEAR(drawn[0], 600.0 * 1 / 7, 30);  // over three standard deviations
  EXPECT_NEAR(drawn[1], 600.0 * 2 / 7, 36);
  EXPECT_NEAR(drawn[2], 600.0 * 4 / 7, 40);
  EXPECT_EQ(plan.source, Run(input, {.max_count = kCount + kCount / 10, .draws = true}).source);
  EXPECT_NE(plan.source,
            Run(input, {.max_count = kCount + kCount / 10, .seed = 2, .draws = true}).source);
}

TEST_P(PlanDensityTest, DrawsNoneOfThoseWithSmallGradients) {
  const Input input = MakeInput({{0, 0.05f, 0.5f, 9e-4f}, {1, 0.05f, 0.5f, 2e-3f}});
  const Plan plan = Run(input, {.max_count = 3, .draws = true});
  EXPECT_THAT(plan.source, ElementsAre(0, 1, 1));
}

TEST_P(PlanDensityTest, KeepsAParentAndAddsOneChild) {
  const Input input = MakeInput({{2, 0.2f, 0.5f, 2e-3f}});
  const Plan plan = Run(input, {.keeps_parent = true});
  EXPECT_EQ(plan.counts.num_split, 1);
  ASSERT_THAT(plan.source, ElementsAre(0, 0));
  ASSERT_THAT(plan.is_new, ::testing::UnorderedElementsAre(0, 1));
  const size_t parent = plan.is_new[0] == 0 ? 0 : 1, child = 1 - parent;
  EXPECT_EQ(plan.At(kMeanPlane, parent), 2.0f);
  EXPECT_EQ(plan.At(kLogScalePlane, parent), std::log(0.2f));
  EXPECT_NE(plan.At(kMeanPlane, child), 2.0f);
  EXPECT_NEAR(plan.At(kLogScalePlane, child), std::log(0.2f / 1.6f), 1e-6);
}

TEST_P(PlanDensityTest, OrdersRowsAlongTheMortonCurve) {
  // Gaussian i is at the corner of a cube given by the bits of 7 - i, x the lowest.
  Input input = MakeInput(std::vector<Blob>(8, {0, 0.05f, 0.5f, 0}));
  for (int64_t i = 0; i < 8; ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      input.gaussians.At(kMeanPlane + axis, i) = static_cast<float>((7 - i) >> axis & 1);
    }
  }
  EXPECT_THAT(Run(input).source, ElementsAre(7, 6, 5, 4, 3, 2, 1, 0));
}

TEST_P(PlanDensityTest, KeepsGaussiansWithMeansThatAreNotFinite) {
  Input input = MakeInput(std::vector<Blob>(4, {1, 0.05f, 0.5f, 0}));
  input.gaussians.At(kMeanPlane, 1) = std::nanf("");
  input.gaussians.At(kMeanPlane + 1, 2) = std::numeric_limits<float>::infinity();
  EXPECT_THAT(Run(input).source, ::testing::UnorderedElementsAre(0, 1, 2, 3));
}

}  // namespace
}  // namespace pepeseg
