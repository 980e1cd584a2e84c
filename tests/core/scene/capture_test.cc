#include "core/scene/capture.h"

#include <gtest/gtest.h>

namespace pepeseg {
namespace {

TEST(SceneRadius, IsThatOfTheCameraCentresWithAMargin) {
  Capture capture;
  const Eigen::Quaterniond rotation(Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()));
  for (const Eigen::Vector3d& center : {Eigen::Vector3d(4, 0, 0), Eigen::Vector3d(0, 0, 0)}) {
    View view;
    view.cam_from_world = {rotation, -(rotation * center)};
    capture.views.push_back(view);
  }
  EXPECT_NEAR(SceneRadius(capture), 2 * 1.1, 1e-12);
}

// As of one view, or of a camera on a tripod.
TEST(SceneRadius, OfCamerasAtOnePlaceIsTheDistanceToThePoints) {
  Capture capture;
  for (int i = 0; i < 3; ++i) {
    View view;
    view.cam_from_world.rotation = Eigen::AngleAxisd(0.1 * i, Eigen::Vector3d::UnitY());
    view.cam_from_world.translation = view.cam_from_world.rotation * Eigen::Vector3d(-7, 0, 0);
    capture.views.push_back(view);
  }
  EXPECT_EQ(SceneRadius(capture), 1);  // nothing tells how far anything is
  for (const float x : {9, 10, 11, 12, 1000}) {
    capture.points.push_back({Eigen::Vector3f(x, 0, 0), {}});
  }
  EXPECT_NEAR(SceneRadius(capture), 11 - 7, 1e-9);
  capture.views[1].cam_from_world.translation.x() += 0.3;  // no longer one place
  EXPECT_NEAR(SceneRadius(capture), 1.1 * 0.2, 1e-9);
}

// In a unit of a thousand kilometres, and in one of micrometres.
TEST(SceneRadius, GoesWithTheUnit) {
  for (const double unit : {1e-9, 1.0, 1e9}) {
    Capture capture;
    for (const double x : {2.0, 0.0}) {
      capture.views.emplace_back().cam_from_world.translation = {unit * x, 0, 0};
    }
    EXPECT_NEAR(SceneRadius(capture), 1.1 * unit, 1e-9 * unit);
  }
}

TEST(SceneRadius, IsNeverZero) { EXPECT_EQ(SceneRadius(Capture()), 1); }

}  // namespace
}  // namespace pepeseg
