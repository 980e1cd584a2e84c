#include "core/scene/capture.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <numeric>

namespace pepeseg {
namespace {

using ::testing::IsNan;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

TEST(SceneRadius, IsTheRadiusOfTheCameraCentresWithAMargin) {
  Capture capture;
  const Eigen::Quaterniond rotation(Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()));
  for (const Eigen::Vector3d& center : {Eigen::Vector3d(4, 0, 0), Eigen::Vector3d(0, 0, 0)}) {
    View view;
    view.cam_from_world = {rotation, -(rotation * center)};
    capture.views.push_back(view);
  }
  EXPECT_NEAR(SceneRadius(capture), 2 * 1.1, 1e-12);
}

// One view, or a camera on a tripod.
TEST(SceneRadius, FallsBackToTheDistanceOfThePointsWhenCamerasCoincide) {
  Capture capture;
  for (int i = 0; i < 3; ++i) {
    View view;
    view.cam_from_world.rotation = Eigen::AngleAxisd(0.1 * i, Eigen::Vector3d::UnitY());
    view.cam_from_world.translation = view.cam_from_world.rotation * Eigen::Vector3d(-7, 0, 0);
    capture.views.push_back(view);
  }
  EXPECT_EQ(SceneRadius(capture), 1);  // no points: no distance is known
  for (const float x : {9, 10, 11, 12, 1000}) {
    capture.points.push_back({Eigen::Vector3f(x, 0, 0), {}});
  }
  EXPECT_NEAR(SceneRadius(capture), 11 - 7, 1e-9);
  capture.views[1].cam_from_world.translation.x() += 0.3;  // no longer one place
  EXPECT_NEAR(SceneRadius(capture), 1.1 * 0.2, 1e-9);
}

// Units from thousands of kilometres to nanometres.
TEST(SceneRadius, ScalesWithTheUnit) {
  for (const double unit : {1e-9, 1.0, 1e9}) {
    Capture capture;
    for (const double x : {2.0, 0.0}) {
      capture.views.emplace_back().cam_from_world.translation = {unit * x, 0, 0};
    }
    EXPECT_NEAR(SceneRadius(capture), 1.1 * unit, 1e-9 * unit);
  }
}

TEST(SceneRadius, IsNeverZero) { EXPECT_EQ(SceneRadius(Capture()), 1); }

TEST(NormalizeDepth, MapsPercentilesToZeroAndOneAndClamps) {
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

TEST(NormalizeDepth, ReturnsNothingWithoutTwoDistinctValues) {
  EXPECT_THAT(NormalizeDepth({3, 3, kNan, 3}), ::testing::IsEmpty());
  EXPECT_THAT(NormalizeDepth({kNan, kNan}), ::testing::IsEmpty());
  // One outlier in 2,000 pixels lies beyond the percentiles.
  std::vector<float> values(2000, 7.0f);
  values[5] = 8;
  EXPECT_THAT(NormalizeDepth(values), ::testing::IsEmpty());
}

}  // namespace
}  // namespace pepeseg
