#include "core/select/connected_parts.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace pepeseg {
namespace {

using Parts = std::vector<int32_t>;

// Returns round Gaussians with a standard deviation of 1 on the x axis.
Gaussians OnALine(const std::vector<float>& x) {
  Gaussians gaussians = Gaussians::Zero(static_cast<int64_t>(x.size()), 0);
  for (size_t i = 0; i < x.size(); ++i) {
    gaussians.Plane(kMeanPlane)[i] = x[i];
    gaussians.Plane(kRotationPlane)[i] = 1;
  }
  return gaussians;
}

TEST(ConnectedParts, ReachThreeDeviationsFromEachSide) {
  const Gaussians gaussians = OnALine({0, 5.9f, 12, 17.9f});
  EXPECT_EQ(ConnectedParts(gaussians, Parts{0, 1, 2, 3}), (Parts{0, 0, 1, 1}));
}

TEST(ConnectedParts, ConsiderOnlySelectedGaussians) {
  const Gaussians gaussians = OnALine({0, 5, 10});
  EXPECT_EQ(ConnectedParts(gaussians, Parts{0, 1, 2}), (Parts{0, 0, 0}));
  EXPECT_EQ(ConnectedParts(gaussians, Parts{2, 0}), (Parts{0, 1}));
  EXPECT_EQ(ConnectedParts(gaussians, Parts{}), Parts{});
}

TEST(ConnectedParts, FollowTheShapeOfTheGaussians) {
  Gaussians gaussians = OnALine({0, 10});
  for (int i = 0; i < 2; ++i) {
    gaussians.Plane(kLogScalePlane)[i] = std::log(2.0f);
    gaussians.Plane(kLogScalePlane + 1)[i] = gaussians.Plane(kLogScalePlane + 2)[i] = -5;
  }
  EXPECT_EQ(ConnectedParts(gaussians, Parts{0, 1}), (Parts{0, 0}));
  // Rotated by a right angle about z, by a quaternion that is not normalised.
  for (int i = 0; i < 2; ++i) {
    gaussians.Plane(kRotationPlane)[i] = gaussians.Plane(kRotationPlane + 3)[i] = 7;
  }
  EXPECT_EQ(ConnectedParts(gaussians, Parts{0, 1}), (Parts{0, 1}));
}

TEST(ConnectedParts, JoinAThousandInARow) {
  std::vector<float> x;
  Parts rows;
  for (int i = 0; i < 1000; ++i) {
    x.push_back(static_cast<float>((i * 37) % 1000));  // not in the order along the line
    rows.push_back(i);
  }
  EXPECT_EQ(ConnectedParts(OnALine(x), rows), Parts(1000, 0));
}

TEST(ConnectedParts, JoinGaussiansWithEqualMeans) {
  EXPECT_EQ(ConnectedParts(OnALine(std::vector<float>(5, 2.0f)), Parts{0, 1, 2, 3, 4}),
            Parts(5, 0));
}

}  // namespace
}  // namespace pepeseg
