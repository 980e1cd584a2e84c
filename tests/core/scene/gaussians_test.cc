#include "core/scene/gaussians.h"

#include <gtest/gtest.h>

#include <vector>

#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

TEST(Gaussians, SelectReturnsTheIndexedGaussiansInOrder) {
  Gaussians gaussians = Gaussians::Zero(4, 1);
  ASSERT_EQ(gaussians.planes.size(), 4u * NumPlanes(1));
  for (int k = 0; k < NumPlanes(1); ++k) {
    for (int i = 0; i < 4; ++i) gaussians.Plane(k)[i] = static_cast<float>(10 * k + i);
  }
  const std::vector<int64_t> rows = {3, 0, 3};
  const Gaussians selected = gaussians.Select(rows);
  ASSERT_EQ(selected.count, 3);
  ASSERT_EQ(selected.sh_degree, 1);
  for (int k = 0; k < NumPlanes(1); ++k) {
    EXPECT_EQ(selected.Plane(k)[0], 10 * k + 3);
    EXPECT_EQ(selected.Plane(k)[1], 10 * k);
    EXPECT_EQ(selected.Plane(k)[2], 10 * k + 3);
  }
}

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
