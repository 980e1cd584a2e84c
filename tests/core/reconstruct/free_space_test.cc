#include "core/reconstruct/free_space.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "tests/testing/synthetic_capture.h"

namespace pepeseg {
namespace {

// Two cameras that look along +z from (0, 0, 0) and (1, 0, 0), and points at a distance.
class FreeSpaceTest : public ::testing::Test {
 protected:
  FreeSpaceTest() {
    for (const double x : {0.0, 1.0}) {
      View& view = capture_.views.emplace_back();
      view.camera = {.width = 10, .height = 10, .fx = 10, .fy = 10, .cx = 5, .cy = 5};
      view.cam_from_world.translation = {-x, 0, 0};
    }
    AddPoint(0, 0, 10);
    radius_ = static_cast<float>(SceneRadius(capture_));
  }

  void AddPoint(float x, float y, float z) {
    capture_.points.push_back({Eigen::Vector3f(x, y, z), {0, 0, 0}});
  }
  bool Contains(float x, float y, float z, double clearance = 0.5) const {
    return FreeSpace(capture_, clearance).Contains({x, y, z});
  }

  Capture capture_;
  float radius_ = 0;
};

TEST_F(FreeSpaceTest, IsInFrontOfTheCameras) {
  const float inside = 0.45f * radius_, outside = 0.55f * radius_;
  EXPECT_TRUE(Contains(0, 0, inside));
  EXPECT_TRUE(Contains(1, 0, inside));
  EXPECT_FALSE(Contains(0, 0, outside));
  EXPECT_FALSE(Contains(0, 0, -inside)) << "behind";
  EXPECT_FALSE(Contains(0, -outside, 0.01f));
  EXPECT_FALSE(Contains(50, 0, 1));
  EXPECT_FALSE(Contains(std::numeric_limits<float>::quiet_NaN(), 0, inside));
}

TEST_F(FreeSpaceTest, KeepsHalfOfTheDistanceOfTheNearestPoint) {
  AddPoint(0, 0.2f, 0.05f);  // which neither photograph shows
  const float distance = std::hypot(0.2f, 0.05f);
  EXPECT_TRUE(Contains(0, 0, 0.49f * distance));
  EXPECT_FALSE(Contains(0, 0, 0.51f * distance));
}

TEST_F(FreeSpaceTest, LeavesOutPointsBehindAndAFewStrayOnes) {
  AddPoint(0, 0, -0.01f);
  for (int i = 0; i < 400; ++i) AddPoint(0, 0, 10);
  AddPoint(0, 0, 0.01f);
  AddPoint(0, 0, 0.02f);
  EXPECT_TRUE(Contains(0, 0, 0.45f * radius_));
}

TEST_F(FreeSpaceTest, IsEmptyWithoutClearancePointsOrTrainingViews) {
  EXPECT_TRUE(FreeSpace(capture_, 0).empty());
  EXPECT_FALSE(FreeSpace(capture_, 0.5).empty());
  for (View& view : capture_.views) view.held_out = true;
  EXPECT_TRUE(FreeSpace(capture_, 0.5).empty());
  for (View& view : capture_.views) view.held_out = false;
  capture_.points.clear();
  EXPECT_TRUE(FreeSpace(capture_, 0.5).empty());
  EXPECT_FALSE(Contains(0, 0, 0.1f));
}

// The grid leaves out no ball.
TEST_F(FreeSpaceTest, FindsWhatComparingWithEachCameraFinds) {
  const Capture capture = testing::MakeSyntheticScene({.num_views = 9}).capture;
  constexpr double kClearance = 0.3;
  const FreeSpace space(capture, kClearance);
  const double radius = kClearance * SceneRadius(capture);
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> within(-1.5 * radius, 1.5 * radius);
  int num_inside = 0, num = 0;
  for (const View& near : capture.views) {
    const Eigen::Vector3d center =
        near.cam_from_world.rotation.conjugate() * -near.cam_from_world.translation;
    for (int i = 0; i < 200; ++i, ++num) {
      const Eigen::Vector3f point =
          (center + Eigen::Vector3d(within(random), within(random), within(random))).cast<float>();
      bool inside = false;
      for (const View& view : capture.views) {
        const Eigen::Vector3d in_camera = view.cam_from_world * point.cast<double>();
        inside |= !view.held_out && in_camera.z() > 0 && in_camera.norm() < radius;
      }
      EXPECT_EQ(space.Contains(point), inside) << point.transpose();
      num_inside += inside ? 1 : 0;
    }
  }
  EXPECT_GT(num_inside, num / 20);
  EXPECT_LT(num_inside, num / 2);
}

}  // namespace
}  // namespace pepeseg
