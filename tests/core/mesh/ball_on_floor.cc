#include "tests/core/mesh/ball_on_floor.h"

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <vector>

#include "core/mesh/make_mesh.h"
#include "kernels/gaussian_planes.h"

namespace pepeseg {
namespace {

constexpr float kGaussianSize = 0.03f;
constexpr float kShConstant = 0.28209479f;

}  // namespace

BallOnFloor MakeBallOnFloor() {
  BallOnFloor scene;
  std::vector<Eigen::Vector3d> places, normals;
  constexpr int kNumOnBall = 4000;
  for (int i = 0; i < kNumOnBall; ++i) {  // a spiral, which covers it evenly
    const double y = 1 - (2 * i + 1.0) / kNumOnBall,
                 angle = i * std::numbers::pi * (3 - std::sqrt(5));
    const double r = std::sqrt(1 - y * y);
    normals.emplace_back(r * std::cos(angle), y, r * std::sin(angle));
    places.push_back(kBallRadius * normals.back());
  }
  for (int i = 0; i < 64; ++i) {
    for (int j = 0; j < 64; ++j) {
      places.emplace_back(-1.2 + 2.4 * i / 63, kBallRadius, -1.2 + 2.4 * j / 63);
      normals.emplace_back(0, -1, 0);
    }
  }
  const auto count = static_cast<int64_t>(places.size());
  Gaussians& gaussians = scene.model.gaussians = Gaussians::Zero(count, 0);
  scene.ball.member.assign(places.size(), 0);
  for (size_t i = 0; i < places.size(); ++i) {
    const bool on_ball = i < kNumOnBall;
    scene.ball.member[i] = on_ball ? 1 : 0;
    const auto rotation =
        Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d(0, 0, 1), normals[i]).cast<float>();
    const float values[] = {rotation.w(), rotation.x(), rotation.y(), rotation.z()};
    for (int k = 0; k < 4; ++k) gaussians.Plane(kRotationPlane + k)[i] = values[k];
    for (int k = 0; k < 3; ++k) {
      gaussians.Plane(kMeanPlane + k)[i] = static_cast<float>(places[i][k]);
      gaussians.Plane(kLogScalePlane + k)[i] = std::log(k == 2 ? 0.002f : kGaussianSize);
      const float color = on_ball ? (k == 0 ? 0.8f : 0.1f) : 0.5f;
      gaussians.Plane(kShPlane + k)[i] = (color - 0.5f) / kShConstant;
    }
    gaussians.Plane(kOpacityPlane)[i] = 4;
  }
  for (int i = 0; i < 12; ++i) {
    const double angle = 2 * std::numbers::pi * i / 12;
    ModelView view;
    view.camera = {.width = 128, .height = 128, .fx = 140, .fy = 140, .cx = 64, .cy = 64};
    view.cam_from_world =
        LookAt({2 * std::cos(angle), i % 2 == 0 ? -1.2 : -0.4, 2 * std::sin(angle)}, {0, 0, 0});
    scene.model.views.push_back(view);
  }
  scene.model.scene_radius = 3;
  return scene;
}

}  // namespace pepeseg
