#include "core/reconstruct/training_views.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <vector>

namespace pepeseg {
namespace {

Capture OneView() {
  Capture capture;
  capture.views.resize(2);
  capture.views[0].held_out = true;
  View& view = capture.views[1];
  view.camera = {9, 8, 12, 10, 4.5, 4};
  view.photo = {9, 8, 3, std::vector<uint8_t>(9 * 8 * 3)};
  for (int i = 0; i < 9 * 8; ++i) {
    for (int c = 0; c < 3; ++c) view.photo.pixels[3 * i + c] = uint8_t(2 * i + 50 * c);
  }
  return capture;
}

TEST(TrainingViews, SkipsHeldOutViews) {
  const auto backend = MakeCpuBackend(1);
  const TrainingViews views(*backend, OneView(), {});
  EXPECT_EQ(views.size(), 1);
  EXPECT_EQ(views.max_pixels(), 72);
  EXPECT_TRUE(views.allocated());
  EXPECT_TRUE(views.At(0, 1).ignore.empty());
}

TEST(TrainingViews, ShrinksToTheMeansOfBlocksAndScalesTheCamera) {
  const auto backend = MakeCpuBackend(1);
  const TrainingViews views(*backend, OneView(), {.coarse = true});
  const TrainingView& half = views.At(0, 2);
  EXPECT_EQ(half.pinhole.width, 4);  // the ninth column has no partner
  EXPECT_EQ(half.pinhole.height, 4);
  EXPECT_FLOAT_EQ(half.pinhole.fx, 6);
  EXPECT_FLOAT_EQ(half.pinhole.cx, 2.25f);
  // Block (1, 0): pixels 2, 3, 11, 12 of the row-major photo: values 4, 6, 22, 24, mean 14.
  EXPECT_EQ(half.photo.span()[3], 14);
  EXPECT_EQ(half.photo.span()[4], 64);
  const TrainingView& quarter = views.At(0, 4);
  EXPECT_EQ(quarter.pinhole.width, 2);
  EXPECT_EQ(quarter.photo.size(), 2 * 2 * 3);
}

TEST(TrainingViews, IgnoresABlockThatHoldsAnIgnoredPixel) {
  Capture capture = OneView();
  capture.views[1].ignore.assign(72, 0);
  capture.views[1].ignore[2 * 9 + 5] = 255;  // (5, 2)
  const auto backend = MakeCpuBackend(1);
  const TrainingViews views(*backend, capture, {.coarse = true});
  const TrainingView& half = views.At(0, 2);
  ASSERT_EQ(half.ignore.size(), 16);
  for (int i = 0; i < 16; ++i) EXPECT_EQ(half.ignore.span()[i] != 0, i == 1 * 4 + 2) << i;
  EXPECT_NE(views.At(0, 4).ignore.span()[1], 0);
}

TEST(TrainingViews, HoldsDepthPriorsOnRequest) {
  Capture capture = OneView();
  capture.views[1].depth.kind = DepthPrior::Kind::kDepth;
  for (int i = 0; i < 72; ++i) {
    const bool known = i >= 2;
    capture.views[1].depth.values.push_back(known ? float(i) / 71 : std::nanf(""));
  }
  const auto backend = MakeCpuBackend(1);
  const TrainingViews views(*backend, capture, {.coarse = true, .with_depth = true});
  EXPECT_TRUE(views.allocated());
  const TrainingView& full = views.At(0, 1);
  EXPECT_EQ(full.prior.size(), 72);
  EXPECT_FALSE(full.inverse_depth);
  // Percentiles of 2..71: one in from either end.
  EXPECT_FLOAT_EQ(full.min_prior, 3.0f / 71);
  EXPECT_FLOAT_EQ(full.max_prior, 70.0f / 71);
  const TrainingView& half = views.At(0, 2);
  ASSERT_EQ(half.prior.size(), 16);
  EXPECT_FLOAT_EQ(half.prior.span()[0], 9.5f / 71);  // pixels 9 and 10: 0 and 1 are unknown
  EXPECT_FLOAT_EQ(half.prior.span()[1], 7.0f / 71);  // pixels 2, 3, 11, 12
  EXPECT_FLOAT_EQ(half.max_prior, 70.0f / 71);
  EXPECT_TRUE(TrainingViews(*backend, capture, {}).At(0, 1).prior.empty());
  for (float& value : capture.views[1].depth.values) value = std::nanf("");
  EXPECT_TRUE(TrainingViews(*backend, capture, {.with_depth = true}).At(0, 1).prior.empty());
}

TEST(TrainingViews, HoldNegativeDisparitiesToCompareThemWithDepth) {
  Capture capture = OneView();
  capture.views[1].depth.kind = DepthPrior::Kind::kDisparity;
  for (int i = 0; i < 72; ++i) capture.views[1].depth.values.push_back(float(i));
  const auto backend = MakeCpuBackend(1);
  const TrainingViews inverse(*backend, capture, {.with_depth = true});
  const TrainingViews linear(*backend, capture,
                             {.with_depth = true, .disparity_as_inverse_depth = false});
  EXPECT_TRUE(inverse.At(0, 1).inverse_depth);
  EXPECT_FALSE(linear.At(0, 1).inverse_depth);
  EXPECT_EQ(inverse.At(0, 1).prior.span()[5], 5);
  EXPECT_EQ(linear.At(0, 1).prior.span()[5], -5);
  EXPECT_EQ(linear.At(0, 1).min_prior, -inverse.At(0, 1).max_prior);
  EXPECT_EQ(linear.At(0, 1).max_prior, -inverse.At(0, 1).min_prior);
  EXPECT_EQ(linear.At(0, 1).prior_deviation, inverse.At(0, 1).prior_deviation);
  capture.views[1].depth.kind = DepthPrior::Kind::kDepth;  // is compared as it is
  EXPECT_EQ(
      TrainingViews(*backend, capture, {.with_depth = true, .disparity_as_inverse_depth = false})
          .At(0, 1)
          .prior.span()[5],
      5);
}

TEST(ViewSampler, DrawsEachViewOnceARound) {
  ViewSampler sampler(std::vector<double>(7, 1));
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

TEST(ViewSampler, DrawsAViewInItsShareOfTheRounds) {
  constexpr int kRounds = 4000;
  ViewSampler sampler({1, 0.25, 0});
  std::mt19937_64 random(3);
  std::vector<int> count(3);
  for (; count[0] < kRounds; ++count[sampler.Next(random)]) {
  }
  EXPECT_NEAR(count[1], 0.25 * kRounds, 100);  // about four standard deviations
  EXPECT_EQ(count[2], 0);
}

TEST(ViewSampler, RepeatsWithTheSeed) {
  const std::vector<double> shares(20, 1);
  ViewSampler a(shares), b(shares), c(shares);
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
