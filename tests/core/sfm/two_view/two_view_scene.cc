#include "two_view_scene.h"

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

namespace pepeseg {
namespace {

constexpr int kWidth = 1000, kHeight = 750;
constexpr double kFocal = 900;

// Returns a number of the normal distribution (Box and Muller).
double Normal(SeededDraws& draws) {
  const double radius = std::sqrt(-2 * std::log(1 - draws.Unit()));
  return radius * std::cos(2 * std::numbers::pi * draws.Unit());
}

Keypoint Noisy(const Eigen::Vector2d& point, double noise, SeededDraws& draws) {
  return {static_cast<float>(point.x() + noise * Normal(draws)),
          static_cast<float>(point.y() + noise * Normal(draws)), 2, 0};
}

}  // namespace

TwoViewCameras TwoViewScene::WithoutFocals() const {
  TwoViewCameras unknown = cameras;
  unknown.first.focal = unknown.second.focal = 0;
  return unknown;
}

TwoViewScene MakeTwoViewScene(const SceneShape& shape) {
  SeededDraws draws(shape.seed);
  TwoViewScene scene;
  scene.cameras.first = scene.cameras.second = {kWidth, kHeight, kFocal};
  const Eigen::Matrix3d k = CameraMatrix(scene.cameras.first);
  scene.pose.rotation = RotationFromVector({0.05, -0.2, 0.03});
  const Eigen::Vector3d translation =
      shape.turn_only ? Eigen::Vector3d::Zero() : Eigen::Vector3d(1, 0.2, -0.3);
  scene.pose.translation = translation.normalized();
  while (static_cast<int>(scene.first.size()) < shape.num_points) {
    const Eigen::Vector2d seen(kWidth * draws.Unit(), kHeight * draws.Unit());
    const Eigen::Vector3d ray = k.inverse() * seen.homogeneous();
    // A slanted plane, or depths from 3 to 9.
    const double depth =
        shape.planar ? 5 / (1 + 0.3 * ray.x() - 0.2 * ray.y()) : 3 + 6 * draws.Unit();
    const Eigen::Vector3d moved = scene.pose.rotation * (depth * ray) + translation;
    const bool is_true = draws.Unit() >= shape.outlier_share;
    Eigen::Vector2d there = (k * moved).hnormalized();
    if (moved.z() <= 0 || there.x() < 0 || there.y() < 0 || there.x() > kWidth ||
        there.y() > kHeight) {
      continue;
    }
    if (!is_true) there = {kWidth * draws.Unit(), kHeight * draws.Unit()};
    const auto index = static_cast<uint32_t>(scene.first.size());
    scene.first.push_back(Noisy(seen, shape.noise, draws));
    scene.second.push_back(Noisy(there, shape.noise, draws));
    scene.matches.push_back({index, index});
    scene.is_true.push_back(is_true);
  }
  return scene;
}

}  // namespace pepeseg
