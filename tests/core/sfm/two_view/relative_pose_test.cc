#include "core/sfm/two_view/relative_pose.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <numbers>
#include <vector>

#include "two_view_scene.h"

namespace pepeseg {
namespace {

std::vector<PointPair> NormalisedPairs(const TwoViewScene& scene) {
  const Eigen::Matrix3d inverse = CameraMatrix(scene.cameras.first).inverse();
  std::vector<PointPair> pairs;
  for (size_t i = 0; i < scene.first.size(); ++i) {
    const Eigen::Vector3d first(scene.first[i].x, scene.first[i].y, 1);
    const Eigen::Vector3d second(scene.second[i].x, scene.second[i].y, 1);
    pairs.push_back({(inverse * first).hnormalized(), (inverse * second).hnormalized()});
  }
  return pairs;
}

TEST(RotationVector, IsUndoneByItsInverse) {
  for (const double angle : {0.0, 1e-13, 1e-6, 0.5, 3.0, std::numbers::pi - 1e-6}) {
    const Eigen::Vector3d vector = angle * Eigen::Vector3d(0.36, -0.48, 0.8);
    const Eigen::Matrix3d rotation = RotationFromVector(vector);
    EXPECT_NEAR(rotation.determinant(), 1, 1e-12);
    EXPECT_LT((VectorFromRotation(rotation) - vector).norm(), 1e-6) << angle;
    EXPECT_NEAR(RotationAngle(rotation), angle, 1e-6);
  }
}

TEST(DecomposeEssential, FindsThePoseWithThePointsInFront) {
  const TwoViewScene scene = MakeTwoViewScene({.num_points = 50, .noise = 0});
  const std::vector<PointPair> pairs = NormalisedPairs(scene);
  for (const double sign : {1.0, -1.0}) {
    const auto found = DecomposeEssential(sign * EssentialMatrix(scene.pose), pairs);
    ASSERT_TRUE(found.has_value());
    EXPECT_EQ(found->num_in_front, 50);
    EXPECT_LT((found->pose.rotation - scene.pose.rotation).norm(), 1e-9);
    EXPECT_LT((found->pose.translation - scene.pose.translation).norm(), 1e-9);
  }
}

TEST(RefineRelativePose, TakesBackADisturbance) {
  for (const bool planar : {false, true}) {
    const TwoViewScene scene = MakeTwoViewScene({.noise = 0, .planar = planar});
    const std::vector<PointPair> pairs = NormalisedPairs(scene);
    const std::vector<double> weights(pairs.size(), 1.0);
    const RelativePose disturbed{
        RotationFromVector({0.01, 0.02, -0.01}) * scene.pose.rotation,
        (scene.pose.translation + Eigen::Vector3d(0.02, -0.05, 0.03)).normalized()};
    const RelativePose refined = RefineRelativePose(disturbed, pairs, weights, 20);
    EXPECT_LT((refined.rotation - scene.pose.rotation).norm(), 1e-5) << planar;
    EXPECT_LT((refined.translation - scene.pose.translation).norm(), 1e-4) << planar;
  }
}

TEST(RefineRelativePose, IgnoresPairsWithoutWeight) {
  const TwoViewScene scene = MakeTwoViewScene({.outlier_share = 0.3, .noise = 0});
  std::vector<double> weights;
  for (const bool is_true : scene.is_true) weights.push_back(is_true ? 1.0 : 0.0);
  const RelativePose disturbed{RotationFromVector({0.01, 0.02, -0.01}) * scene.pose.rotation,
                               scene.pose.translation};
  const RelativePose refined = RefineRelativePose(disturbed, NormalisedPairs(scene), weights, 20);
  EXPECT_LT((refined.rotation - scene.pose.rotation).norm(), 1e-5);
}

}  // namespace
}  // namespace pepeseg
