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

TEST(SceneRadius, IsNeverZero) {
  Capture capture;
  EXPECT_GT(SceneRadius(capture), 0);
  capture.views.resize(3);
  EXPECT_DOUBLE_EQ(SceneRadius(capture), 1e-6);
}

}  // namespace
}  // namespace pepeseg
