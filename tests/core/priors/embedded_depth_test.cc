#include "core/priors/embedded_depth.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/priors/priors.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/synthetic_capture.h"

namespace pepeseg {
namespace {

constexpr int kDepthWidth = 160, kDepthHeight = 120;

// A wall at z = 4 with a box at z = 2 in front of its left half.
bool IsBox(double x) { return x < 80; }
View WallAndBox() {
  View view;
  view.camera = {kDepthWidth, kDepthHeight, 100, 100, 80, 60};
  view.photo = {kDepthWidth, kDepthHeight, 3, {}};
  for (int y = 0; y < kDepthHeight; ++y) {
    for (int x = 0; x < kDepthWidth; ++x) {
      const uint8_t red = IsBox(x) ? 200 : 60;
      view.photo.pixels.insert(view.photo.pixels.end(), {red, 90, 80});
    }
  }
  return view;
}

// Returns a point on the surface for every `step` pixels.
std::vector<ScenePoint> Points(int step) {
  std::vector<ScenePoint> points;
  for (int y = 4; y < kDepthHeight; y += step) {
    for (int x = 4; x < kDepthWidth; x += step) {
      const float z = IsBox(x) ? 2.0f : 4.0f;
      const auto u = static_cast<float>(x) + 0.5f, v = static_cast<float>(y) + 0.5f;
      points.push_back({{(u - 80) / 100 * z, (v - 60) / 100 * z, z}, {}});
    }
  }
  return points;
}

TEST(EmbeddedDepth, SpreadsThePointsDepthUpToBoundaries) {
  const std::vector<float> depth = EmbeddedDepth(WallAndBox(), Points(16));
  ASSERT_EQ(depth.size(), size_t{kDepthWidth * kDepthHeight});
  for (int y = 0; y < kDepthHeight; ++y) {
    for (int x = 0; x < kDepthWidth; ++x) {
      if (std::abs(x - 80) < 8) continue;  // boundaries are blurred over this width
      ASSERT_NEAR(depth[y * kDepthWidth + x], IsBox(x) ? 2 : 4, IsBox(x) ? 0.1 : 0.3)
          << x << ", " << y;
    }
  }
}

TEST(EmbeddedDepth, IgnoresPointsBehindNearerOnes) {
  std::vector<ScenePoint> points = Points(8);
  for (const ScenePoint& point : Points(16)) {  // the wall continues behind the box
    if (point.position.z() == 2.0f) points.push_back({2 * point.position, {}});
    if (point.position.z() == 2.0f) {
      points.push_back({2 * point.position + Eigen::Vector3f(0.1f, 0.1f, 0), {}});
    }
  }
  const std::vector<float> depth = EmbeddedDepth(WallAndBox(), points);
  for (int y = 10; y < kDepthHeight - 10; ++y) {
    for (int x = 10; x < 70; ++x) ASSERT_NEAR(depth[y * kDepthWidth + x], 2, 0.1) << x << ", " << y;
  }
}

TEST(EmbeddedDepth, IsUnknownFarFromPointsAndWhereIgnored) {
  std::vector<ScenePoint> points;
  for (const ScenePoint& point : Points(8)) {
    if (point.position.z() == 2.0f) points.push_back(point);
  }
  View view = WallAndBox();
  view.ignore.assign(kDepthWidth * kDepthHeight, 0);
  view.ignore[60 * kDepthWidth + 30] = 1;
  const std::vector<float> depth = EmbeddedDepth(view, points);
  EXPECT_TRUE(std::isnan(depth[60 * kDepthWidth + 30]));
  EXPECT_FALSE(std::isnan(depth[60 * kDepthWidth + 31]));
  EXPECT_TRUE(std::isnan(depth[60 * kDepthWidth + 150]));
}

TEST(EmbeddedDepth, IsEmptyWithTooFewPoints) {
  EXPECT_TRUE(EmbeddedDepth(WallAndBox(), Points(100)).empty());
  std::vector<ScenePoint> behind = Points(8);
  for (ScenePoint& point : behind) point.position.z() = -point.position.z();
  EXPECT_TRUE(EmbeddedDepth(WallAndBox(), behind).empty());
}

TEST(EmbeddedDepth, OrdersThePixelsOfATexturedScene) {
  const testing::SyntheticScene scene = testing::MakeSyntheticScene(
      {.num_views = 2, .width = 160, .height = 120, .depth = DepthPrior::Kind::kDepth});
  const View& view = scene.capture.views[1];
  const std::vector<float> depth = EmbeddedDepth(view, scene.capture.points);
  ASSERT_FALSE(depth.empty());
  int64_t right = 0, all = 0;  // pairs of pixels whose depths differ
  for (size_t i = 0; i < depth.size(); i += 37) {
    for (size_t j = i + 41; j < depth.size(); j += 113) {
      const float difference = view.depth.values[j] - view.depth.values[i];
      if (std::abs(difference) < 0.05f || std::isnan(depth[i]) || std::isnan(depth[j])) continue;
      right += (depth[j] > depth[i]) == (difference > 0) ? 1 : 0;
      ++all;
    }
  }
  ASSERT_GT(all, 1000);
  EXPECT_GT(static_cast<double>(right) / static_cast<double>(all), 0.93);
}

TEST(EmbedPriors, FillsInWhatTrainingViewsLack) {
  testing::SyntheticScene scene =
      testing::MakeSyntheticScene({.num_views = 5, .held_out_every = 4, .with_masks = false});
  Capture& capture = scene.capture;
  capture.views[2].depth.values.assign(capture.views[2].photo.pixels.size() / 3, 0.5f);
  int reported = 0;
  EXPECT_OK(EmbedPriors({true, true}, 2, capture, [&](int done, int num_views) {
    EXPECT_EQ(num_views, 3);
    reported = done;
    return absl::OkStatus();
  }));
  EXPECT_EQ(reported, 3);
  for (const View& view : capture.views) {
    EXPECT_EQ(view.masks.empty(), view.held_out) << view.name;
    EXPECT_EQ(HasDepthPrior(view), !view.held_out) << view.name;
  }
  EXPECT_EQ(capture.views[2].depth.values[7], 0.5f);  // kept: the view had a prior
  EXPECT_EQ(capture.views[1].depth.kind, DepthPrior::Kind::kDepth);
}

TEST(EmbedPriors, EndsWithTheErrorOfItsProgress) {
  testing::SyntheticScene scene =
      testing::MakeSyntheticScene({.num_views = 6, .with_masks = false});
  const absl::Status status = EmbedPriors({true, false}, 1, scene.capture, [](int done, int) {
    return done < 2 ? absl::OkStatus() : absl::CancelledError();
  });
  EXPECT_TRUE(absl::IsCancelled(status));
  EXPECT_TRUE(scene.capture.views.back().masks.empty());
  EXPECT_FALSE(HasDepthPrior(scene.capture.views[1]));
}

TEST(EmbedPriors, DoesNotDependOnTheNumberOfThreads) {
  testing::SyntheticScene one = testing::MakeSyntheticScene({.num_views = 3, .with_masks = false});
  testing::SyntheticScene two = one;
  const auto proceed = [](int, int) { return absl::OkStatus(); };
  EXPECT_OK(EmbedPriors({true, true}, 1, one.capture, proceed));
  EXPECT_OK(EmbedPriors({true, true}, 2, two.capture, proceed));
  for (size_t i = 0; i < one.capture.views.size(); ++i) {
    EXPECT_EQ(one.capture.views[i].masks.pixel_cell, two.capture.views[i].masks.pixel_cell);
  }
}

}  // namespace
}  // namespace pepeseg
