#include "core/scene/camera.h"

#include <algorithm>
#include <cmath>

#include "kernels/ops/render.h"

namespace pepeseg {

Eigen::Vector3d OriginOf(std::span<const Pose> cams_from_world) {
  constexpr double kFar = 100;  // in units of `spread`
  if (cams_from_world.empty()) return Eigen::Vector3d::Zero();
  // The translation of world_from_cam is the camera's centre.
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const Pose& pose : cams_from_world) middle += pose.Inverse().translation;
  middle /= static_cast<double>(cams_from_world.size());
  double spread = 0;
  for (const Pose& pose : cams_from_world) {
    spread = std::max(spread, (pose.Inverse().translation - middle).norm());
  }
  return middle.norm() > kFar * spread ? middle : Eigen::Vector3d::Zero();
}

Pose RelativeTo(const Eigen::Vector3d& origin, const Pose& cam_from_world) {
  // R x + t with x = y + origin is R y + (R origin + t). Only the quaternion that rotates the
  // origin is normalised: the stored rotation stays as the dataset gave it.
  const Eigen::Quaterniond rotation = cam_from_world.rotation.normalized();
  return {cam_from_world.rotation, rotation * origin + cam_from_world.translation};
}

Pose InWorld(const Eigen::Vector3d& origin, const Pose& cam_from_origin) {
  return RelativeTo(-origin, cam_from_origin);
}

// Takes the middle pixel of each cell of stride x stride pixels.
std::vector<int32_t> GridPixels(const Camera& camera, double max_cells) {
  const double num_pixels = double{1} * camera.width * camera.height;
  const int stride = std::max(1, static_cast<int>(std::ceil(std::sqrt(num_pixels / max_cells))));
  std::vector<int32_t> pixels;
  for (int y = stride / 2; y < camera.height; y += stride) {
    for (int x = stride / 2; x < camera.width; x += stride) pixels.push_back(y * camera.width + x);
  }
  return pixels;
}

Camera Resized(const Camera& camera, int width, int height) {
  const double by_x = static_cast<double>(width) / camera.width;
  const double by_y = static_cast<double>(height) / camera.height;
  return {width, height, camera.fx * by_x, camera.fy * by_y, camera.cx * by_x, camera.cy * by_y};
}

PinholeView ToPinholeView(const Camera& camera, const Pose& cam_from_world) {
  PinholeView view;
  view.width = camera.width;
  view.height = camera.height;
  view.fx = static_cast<float>(camera.fx);
  view.fy = static_cast<float>(camera.fy);
  view.cx = static_cast<float>(camera.cx);
  view.cy = static_cast<float>(camera.cy);
  const Eigen::Matrix3d rotation = cam_from_world.rotation.normalized().toRotationMatrix();
  for (int row = 0; row < 3; ++row) {
    for (int col = 0; col < 3; ++col) {
      view.cam_from_world[4 * row + col] = static_cast<float>(rotation(row, col));
    }
    view.cam_from_world[4 * row + 3] = static_cast<float>(cam_from_world.translation[row]);
  }
  return view;
}

}  // namespace pepeseg
