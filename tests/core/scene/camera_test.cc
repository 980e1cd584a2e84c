#include "core/scene/camera.h"

#include <gtest/gtest.h>

#include <vector>

namespace pepeseg {
namespace {

const Eigen::Quaterniond kRotation(Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()));

std::vector<Pose> CamerasAt(const std::vector<Eigen::Vector3d>& centers) {
  std::vector<Pose> poses;
  for (const Eigen::Vector3d& center : centers) poses.push_back({kRotation, -(kRotation * center)});
  return poses;
}

TEST(OriginOf, IsZeroUnlessTheCamerasAreFarComparedToTheirSpread) {
  EXPECT_EQ(OriginOf({}), Eigen::Vector3d::Zero());
  EXPECT_EQ(OriginOf(CamerasAt({{90, 0, 0}, {92, 0, 0}})), Eigen::Vector3d::Zero());
  EXPECT_EQ(OriginOf(CamerasAt({{0, 0, 0}, {0, 0, 0}})), Eigen::Vector3d::Zero());
}

TEST(OriginOf, IsTheMeanOfCamerasFarAway) {
  const Eigen::Vector3d middle(4e5, 5.3e6, 100);
  const Eigen::Vector3d offset(1, 0, 2);
  EXPECT_LT((OriginOf(CamerasAt({middle - offset, middle + offset})) - middle).norm(), 1e-8);
}

TEST(RelativeTo, IsUndoneByInWorld) {
  const Eigen::Vector3d origin(4e5, 5.3e6, 100), point = origin + Eigen::Vector3d(1, 2, 3);
  const Pose world = {kRotation, {7, 8, 9}};
  const Pose relative = RelativeTo(origin, world);
  EXPECT_LT((relative * (point - origin) - world * point).norm(), 1e-8);
  const Pose back = InWorld(origin, relative);
  EXPECT_LT((back.translation - world.translation).norm(), 1e-8);
  EXPECT_EQ(back.rotation.coeffs(), world.rotation.coeffs());
}

}  // namespace
}  // namespace pepeseg
