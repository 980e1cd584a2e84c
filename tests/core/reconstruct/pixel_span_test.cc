#include "core/reconstruct/pixel_span.h"

#include <gtest/gtest.h>

#include <cmath>

namespace pepeseg {
namespace {

Capture ViewsWithFocals(const std::vector<double>& focals) {
  Capture capture;
  for (const double focal : focals) {
    View& view = capture.views.emplace_back();
    view.camera = {640, 480, focal, 0.5 * focal, 320, 240};
    view.cam_from_world.translation = {0, 0, 5};
  }
  return capture;
}

TEST(PixelSpan, IsTheDepthOfThePointsOverTheFocalLength) {
  const Capture capture = ViewsWithFocals({100, 1000, 1e5});
  std::vector<ScenePoint> points;
  // The last two are behind the cameras.
  for (const float z : {-4, 5, 45, -6, -7}) points.push_back({Eigen::Vector3f(1, 2, z), {}});
  EXPECT_NEAR(PixelSpan(capture, points), 10.0 / 1000, 1e-9);
}

TEST(PixelSpan, IsInfiniteWhereNothingIsInFront) {
  const Capture capture = ViewsWithFocals({100});
  EXPECT_TRUE(std::isinf(PixelSpan(capture, {})));
  EXPECT_TRUE(std::isinf(PixelSpan(capture, {{Eigen::Vector3f(0, 0, -6), {}}})));
  EXPECT_TRUE(std::isinf(PixelSpan(Capture(), {{Eigen::Vector3f(0, 0, 6), {}}})));
}

}  // namespace
}  // namespace pepeseg
