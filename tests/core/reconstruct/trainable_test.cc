#include "core/reconstruct/trainable.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace pepeseg {
namespace {

// Returns cameras turned about the vertical axis, from -half to half degrees, on an arc about a
// point at the distance `radius` in front of them. 0: all at one place.
Capture Arc(double half, int num_views, double radius) {
  Capture capture;
  for (int i = 0; i < num_views; ++i) {
    const double share = num_views > 1 ? double(i) / (num_views - 1) : 0.5;
    const double angle = (2 * share - 1) * half * std::numbers::pi / 180;
    View view;
    view.cam_from_world.rotation =
        Eigen::Quaterniond(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitY()));
    view.cam_from_world.translation = {0, 0, radius};
    capture.views.push_back(view);
  }
  return capture;
}

TEST(ViewingSpread, IsTheRootMeanSquareAngle) {
  EXPECT_NEAR(ViewingSpread(Arc(45, 1001, 3)), 45 / std::sqrt(3), 0.05);
  EXPECT_NEAR(ViewingSpread(Arc(10, 2, 3)), 10, 1e-9);
  EXPECT_NEAR(ViewingSpread(Arc(10, 1, 3)), 0, 1e-6);
  EXPECT_EQ(ViewingSpread({}), 0);
}

TEST(ViewingSpread, Is180DegreesWhenDirectionsCancelOut) {
  EXPECT_EQ(ViewingSpread(Arc(90, 2, 0)), 180);
}

TEST(ViewingSpread, IgnoresHeldOutViews) {
  Capture capture = Arc(60, 3, 3);
  capture.views.front().held_out = capture.views.back().held_out = true;
  EXPECT_NEAR(ViewingSpread(capture), 0, 1e-6);
}

TEST(FindCaptureKind, DistinguishesOrbitsFromForwardFacingCaptures) {
  EXPECT_EQ(FindCaptureKind(Arc(180, 36, 3)), CaptureKind::kOrbit);
  EXPECT_EQ(FindCaptureKind(Arc(45, 12, 3)), CaptureKind::kOrbit);
  EXPECT_EQ(FindCaptureKind(Arc(30, 12, 3)), CaptureKind::kForwardFacing);
  EXPECT_EQ(FindCaptureKind(Arc(10, 20, 3)), CaptureKind::kForwardFacing);
  EXPECT_EQ(FindCaptureKind(Arc(0, 20, 3)), CaptureKind::kForwardFacing);
}

TEST(FindCaptureKind, DoesNotDependOnRollOrTheWorldsAxes) {
  for (const double half : {20.0, 60.0}) {
    Capture capture = Arc(half, 9, 3);
    const CaptureKind kind = FindCaptureKind(capture);
    const Eigen::Quaterniond world(0.2, 0.5, -0.3, 0.7);
    for (size_t i = 0; i < capture.views.size(); ++i) {
      const Eigen::AngleAxisd roll(0.4 * static_cast<double>(i), Eigen::Vector3d::UnitZ());
      Eigen::Quaterniond& rotation = capture.views[i].cam_from_world.rotation;
      rotation = roll * rotation * world.normalized();
    }
    EXPECT_EQ(FindCaptureKind(capture), kind);
  }
}

}  // namespace
}  // namespace pepeseg
