#include "core/select/gaussian_sets.h"

#include <gtest/gtest.h>

#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using Members = std::vector<uint8_t>;

TEST(GaussianSets, CombineMemberByMember) {
  const GaussianSet a = {{0, 0, 1, 1}}, b = {{0, 1, 0, 1}};
  ASSERT_OK_AND_ASSIGN(const GaussianSet both, Union(a, b));
  EXPECT_EQ(both.member, (Members{0, 1, 1, 1}));
  ASSERT_OK_AND_ASSIGN(const GaussianSet rest, Subtract(a, b));
  EXPECT_EQ(rest.member, (Members{0, 0, 1, 0}));
  ASSERT_OK_AND_ASSIGN(const GaussianSet common, Intersect(a, b));
  EXPECT_EQ(common.member, (Members{0, 0, 0, 1}));
}

TEST(GaussianSets, AreRefusedIfOfDifferentModels) {
  const GaussianSet a = {{0, 1}}, b = {{1}};
  EXPECT_STATUS(Union(a, b), absl::StatusCode::kInvalidArgument, "sets of 2 and of 1 Gaussians");
  EXPECT_STATUS(Subtract(a, b), absl::StatusCode::kInvalidArgument, "same model");
  EXPECT_STATUS(Intersect(a, b), absl::StatusCode::kInvalidArgument, "same model");
}

TEST(BoundsOf, EncloseTheMeansOfTheMembers) {
  Gaussians gaussians = Gaussians::Zero(3, 0);
  const float means[3][3] = {{1, -2, 3}, {-4, 5, 0.5f}, {100, 100, 100}};
  for (int i = 0; i < 3; ++i) {
    for (int axis = 0; axis < 3; ++axis) gaussians.Plane(kMeanPlane + axis)[i] = means[i][axis];
  }
  const SetBounds bounds = BoundsOf(gaussians, {{1, 1, 0}});
  EXPECT_FALSE(bounds.empty());
  EXPECT_EQ(bounds.min, Eigen::Vector3d(-4, -2, 0.5));
  EXPECT_EQ(bounds.max, Eigen::Vector3d(1, 5, 3));
  EXPECT_TRUE(BoundsOf(gaussians, {{0, 0, 0}}).empty());
}

}  // namespace
}  // namespace pepeseg
