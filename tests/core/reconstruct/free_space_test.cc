#include "core/reconstruct/free_space.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "tests/testing/synthetic_capture.h"

namespace pepeseg {
namespace {

// Two cameras that look along +z from (0, 0, 0) and (1, 0, 0), and points at a distance. Both show
// what is 2 or more in front of them and between them, and each shows alone what is nearer.
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
  EXPECT_FALSE(Contains(0, 0, -outside)) << "behind";
  EXPECT_FALSE(Contains(0, -outside, 0.01f));
  EXPECT_FALSE(Contains(50, 0, 1));
  EXPECT_FALSE(Contains(std::numeric_limits<float>::quiet_NaN(), 0, inside));
}

TEST_F(FreeSpaceTest, IsHalfwayBetweenCamerasThatLookTheSameWay) {
  constexpr double kClearance = 0.2;
  const float inside = 0.15f * radius_;
  ASSERT_LT(kClearance * radius_, 0.45f) << "the cameras' own balls must not reach the middle";
  EXPECT_TRUE(Contains(0.5f, 0, inside, kClearance));
  EXPECT_FALSE(Contains(0.5f, 0, -inside, kClearance)) << "only in front";
  EXPECT_FALSE(Contains(0.5f, 0, 0.25f * radius_, kClearance));
  const Eigen::AngleAxisd turn(M_PI, Eigen::Vector3d::UnitY());
  Pose& second = capture_.views[1].cam_from_world;
  second = {Eigen::Quaterniond(turn), turn * second.translation};
  AddPoint(0, 0, -10);
  EXPECT_FALSE(Contains(0.5f, 0, inside, kClearance));
  EXPECT_TRUE(Contains(1, 0, -inside, kClearance));
}

TEST_F(FreeSpaceTest, KeepsHalfOfTheDistanceOfTheNearestPointInFront) {
  // With so short a focal length both photographs show the points below.
  for (View& view : capture_.views) view.camera.fx = view.camera.fy = 0.1f;
  AddPoint(0, 0.2f, 0.05f);
  const float distance = std::hypot(0.2f, 0.05f);
  EXPECT_TRUE(Contains(0, 0, 0.49f * distance));
  EXPECT_FALSE(Contains(0, 0, 0.51f * distance));
}

TEST_F(FreeSpaceTest, IsAllAroundACameraWhereAtMostOnePhotographShowsIt) {
  AddPoint(0, 0.2f, 0.05f);  // which neither photograph shows
  const float distance = std::hypot(0.2f, 0.05f);
  for (const float sign : {-1.0f, 1.0f}) {
    EXPECT_TRUE(Contains(0, 0, sign * 0.74f * distance));
    EXPECT_FALSE(Contains(0, 0, sign * 0.76f * distance));
    EXPECT_TRUE(Contains(0, sign * 0.74f * distance, 0));
  }
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

// Returns how many training photographs show a point.
int NumViewsThatShow(const Capture& capture, const Eigen::Vector3d& point) {
  int count = 0;
  for (const View& view : capture.views) {
    const Eigen::Vector3d in_camera = view.cam_from_world * point;
    if (view.held_out || in_camera.z() <= 0) continue;
    const double x = view.camera.fx * in_camera.x() / in_camera.z() + view.camera.cx;
    const double y = view.camera.fy * in_camera.y() / in_camera.z() + view.camera.cy;
    count += x >= 0 && y >= 0 && x < view.camera.width && y < view.camera.height ? 1 : 0;
  }
  return count;
}

// Returns the training cameras and those halfway to the three nearest that look the same way.
std::vector<Pose> Cameras(const Capture& capture) {
  std::vector<Pose> world_from_cam;
  for (const View& view : capture.views) {
    if (!view.held_out) world_from_cam.push_back(view.cam_from_world.Inverse());
  }
  std::vector<Pose> cameras;
  for (const Pose& pose : world_from_cam) {
    cameras.push_back(pose.Inverse());
    std::vector<Pose> others = world_from_cam;
    std::sort(others.begin(), others.end(), [&](const Pose& a, const Pose& b) {
      return (a.translation - pose.translation).norm() < (b.translation - pose.translation).norm();
    });
    for (const size_t k : {1, 2, 3}) {  // 0 is the camera itself
      const Eigen::Vector3d z = Eigen::Vector3d::UnitZ();
      if ((pose.rotation * z).dot(others[k].rotation * z) < 0.5) continue;
      const Pose halfway = {pose.rotation.slerp(0.5, others[k].rotation),
                            (pose.translation + others[k].translation) / 2};
      cameras.push_back(halfway.Inverse());
    }
  }
  return cameras;
}

// The grid leaves out no ball.
TEST_F(FreeSpaceTest, FindsWhatComparingWithEachCameraFinds) {
  const Capture capture = testing::MakeSyntheticScene({.num_views = 9}).capture;
  const std::vector<Pose> cameras = Cameras(capture);
  ASSERT_GT(cameras.size(), 10u) << "some are halfway";
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
      bool inside = false, is_near = false;
      for (const Pose& camera : cameras) {
        const Eigen::Vector3d in_camera = camera * point.cast<double>();
        inside |= in_camera.z() > 0 && in_camera.norm() < radius;
      }
      for (const View& view : capture.views) {
        is_near |= !view.held_out && (view.cam_from_world * point.cast<double>()).norm() < radius;
      }
      inside |= is_near && NumViewsThatShow(capture, point.cast<double>()) <= 1;
      EXPECT_EQ(space.Contains(point), inside) << point.transpose();
      num_inside += inside ? 1 : 0;
    }
  }
  EXPECT_GT(num_inside, num / 20);
  EXPECT_LT(num_inside, num / 2);
}

}  // namespace
}  // namespace pepeseg
