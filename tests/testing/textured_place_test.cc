#include "tests/testing/textured_place.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <vector>

namespace pepeseg::testing {
namespace {

const std::vector<Eigen::Vector3d> kCenters = {{0, 0, 0}, {1, 0, 0}, {0, 2, 0}, {0, 0, 3}};

std::vector<Eigen::Vector3d> Moved(double scale, double mirror) {
  const Eigen::AngleAxisd turn(1, Eigen::Vector3d(1, 2, 3).normalized());
  std::vector<Eigen::Vector3d> moved;
  for (Eigen::Vector3d center : kCenters) {
    center.x() *= mirror;
    moved.push_back(scale * (turn * center) + Eigen::Vector3d(5, 6, 7));
  }
  return moved;
}

TEST(CenterError, IsZeroUpToASimilarity) {
  EXPECT_NEAR(CenterError(Moved(3, 1), kCenters), 0, 1e-9);
}

TEST(CenterError, DetectsAMirrorImage) { EXPECT_GT(CenterError(Moved(3, -1), kCenters), 0.1); }

TEST(CenterError, IsRelativeToTheRadius) {
  std::vector<Eigen::Vector3d> off = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}};
  const std::vector<Eigen::Vector3d> truth = off;
  for (size_t i = 0; i < off.size(); ++i) off[i].z() += i < 2 ? 0.01 : -0.01;
  EXPECT_NEAR(CenterError(off, truth), 0.01, 1e-4);
}

}  // namespace
}  // namespace pepeseg::testing
