#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace pepeseg {

// A pinhole camera, pixels; pixel centres at integer + 0.5. Distorted cameras are undistorted at
// import and never get here.
struct Camera {
  int width = 0;
  int height = 0;
  double fx = 0, fy = 0, cx = 0, cy = 0;

  bool operator==(const Camera&) const = default;
};

// A rigid transform: x_to = rotation * x_from + translation. World: COLMAP's; camera axes: x right,
// y down, z forward (OpenCV).
struct Pose {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Eigen::Vector3d operator*(const Eigen::Vector3d& x) const { return rotation * x + translation; }
  Pose Inverse() const { return {rotation.conjugate(), -(rotation.conjugate() * translation)}; }
};

}  // namespace pepeseg
