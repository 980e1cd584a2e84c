#include "core/reconstruct/initial_gaussians.h"

#include <gtest/gtest.h>

#include <cmath>

#include "kernels/math/sh.h"
#include "tests/testing/synthetic_capture.h"

namespace pepeseg {
namespace {

ScenePoint At(float x, float y, float z) {
  ScenePoint point;
  point.position = {x, y, z};
  point.rgb[0] = 255;
  return point;
}

TEST(InitialGaussians, AreAsWideAsTheMeanDistanceToThreeNeighbours) {
  // The neighbours of the first point are 1, 2 and 4 away; the fifth point is not among the 3.
  const std::vector<ScenePoint> points = {At(0, 0, 0), At(1, 0, 0), At(0, 2, 0), At(0, 0, 4),
                                          At(9, 9, 9)};
  const Gaussians gaussians = InitialGaussians(points, 2, {-10, 10});
  ASSERT_EQ(gaussians.count, 5);
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(gaussians.Plane(kLogScalePlane + axis)[0], std::log(7.0 / 3), 1e-6);
  }
  EXPECT_EQ(gaussians.Plane(kMeanPlane + 2)[3], 4);
  EXPECT_EQ(gaussians.Plane(kRotationPlane)[0], 1);
  EXPECT_NEAR(1 / (1 + std::exp(-gaussians.Plane(kOpacityPlane)[0])), 0.1, 1e-6);
  EXPECT_NEAR(gaussians.Plane(kShPlane)[0] * kSh0 + 0.5, 1, 1e-6);      // red
  EXPECT_NEAR(gaussians.Plane(kShPlane + 1)[0] * kSh0 + 0.5, 0, 1e-6);  // green
}

TEST(InitialGaussians, StayWithinTheBoundsForLoneAndDuplicatePoints) {
  const Gaussians alone = InitialGaussians({At(0, 0, 0)}, 0, {-3, 1});
  // A hundredth of the reach; the largest size is half of the reach.
  const float lone = 1 + std::log(0.02f);
  EXPECT_FLOAT_EQ(alone.Plane(kLogScalePlane)[0], lone);
  const Gaussians twice = InitialGaussians({At(1, 1, 1), At(1, 1, 1)}, 0, {-3, 1});
  EXPECT_FLOAT_EQ(twice.Plane(kLogScalePlane)[1], lone);
  const Gaussians near = InitialGaussians({At(0, 0, 0), At(1e-5f, 0, 0)}, 0, {-3, 1});
  EXPECT_FLOAT_EQ(near.Plane(kLogScalePlane)[0], -3);
  const Gaussians far = InitialGaussians({At(0, 0, 0), At(900, 0, 0)}, 0, {-3, 1});
  EXPECT_FLOAT_EQ(far.Plane(kLogScalePlane)[0], 1);
}

TEST(StartingPoints, AreTheCapturesPointsIfItHasAny) {
  const Capture capture = testing::MakeSyntheticScene().capture;
  ReconstructOptions options;
  std::mt19937_64 random(1);
  EXPECT_EQ(StartingPoints(capture, options, random).size(), capture.points.size());
  options.max_gaussians = 100;
  const size_t thinned = StartingPoints(capture, options, random).size();
  EXPECT_LE(thinned, 100u);
  EXPECT_GT(thinned, 50u);
}

// A wrong match may put a point anywhere.
TEST(StartingPoints, LackPointsFarOutsideTheScene) {
  Capture capture = testing::MakeSyntheticScene().capture;
  const size_t num_points = capture.points.size();
  capture.points.push_back(At(2e7f, 0, 0));
  capture.points.push_back(At(30, 0, 0));
  std::mt19937_64 random(1);
  EXPECT_EQ(StartingPoints(capture, {}, random).size(), num_points + 1);
}

TEST(StartingPoints, AreRandomPointsInTheViewsOtherwise) {
  Capture capture = testing::MakeSyntheticScene().capture;
  capture.points.clear();
  ReconstructOptions options;
  options.num_random_points = 300;
  std::mt19937_64 random(1);
  const auto points = StartingPoints(capture, options, random);
  ASSERT_EQ(points.size(), 300u);
  for (const ScenePoint& point : points) {
    int num_seeing = 0;
    for (const View& view : capture.views) {
      const Eigen::Vector3d x = view.cam_from_world * point.position.cast<double>();
      const double u = view.camera.fx * x.x() / x.z() + view.camera.cx;
      const double v = view.camera.fy * x.y() / x.z() + view.camera.cy;
      num_seeing += x.z() > 0 && u >= -1e-3 && v >= -1e-3 && u <= view.camera.width + 1e-3 &&
                    v <= view.camera.height + 1e-3;
    }
    EXPECT_GE(num_seeing, 1);
  }
}

TEST(LogScaleBounds, FollowTheScenesSize) {
  Capture capture = testing::MakeSyntheticScene().capture;
  const LogScaleBounds small = BoundLogScales(capture, capture.points);
  for (View& view : capture.views) view.cam_from_world.translation *= 10;
  for (ScenePoint& point : capture.points) point.position *= 10;
  const LogScaleBounds large = BoundLogScales(capture, capture.points);
  EXPECT_NEAR(large.min - small.min, std::log(10), 1e-4);
  EXPECT_NEAR(large.max - small.max, std::log(10), 1e-4);
  EXPECT_LT(small.min, std::log(1e-4));
  EXPECT_GT(small.max, std::log(1));
}

}  // namespace
}  // namespace pepeseg
