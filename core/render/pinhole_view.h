#pragma once

#include "core/scene/camera.h"
#include "kernels/ops/render.h"

namespace pepeseg {

// Returns the camera and pose of a view in the backend's form: single precision, row-major.
inline PinholeView ToPinholeView(const Camera& camera, const Pose& cam_from_world) {
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

// Returns the view at 1 / `factor` of its size, cropped to whole blocks of pixels.
inline PinholeView Shrink(PinholeView view, int factor) {
  const auto f = static_cast<float>(factor);
  view.width /= factor;
  view.height /= factor;
  view.fx /= f, view.fy /= f, view.cx /= f, view.cy /= f;
  return view;
}

}  // namespace pepeseg
