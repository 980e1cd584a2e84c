#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <span>
#include <vector>

namespace pepeseg {

struct PinholeView;  // kernels/ops/render.h

// A pinhole camera. All numbers are pixels; the centre of pixel (x, y) is at (x + 0.5, y + 0.5).
// Images of other lenses are undistorted at import (view_warp.h), so that every Camera is a
// pinhole.
struct Camera {
  int width = 0;
  int height = 0;
  double fx = 0, fy = 0, cx = 0, cy = 0;

  bool operator==(const Camera&) const = default;
};

// A rigid transform: x_to = rotation * x_from + translation. The world is COLMAP's; the axes of a
// camera are x right, y down, z forward (OpenCV). Lengths are scene units.
struct Pose {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  // Transforms the point `x`.
  Eigen::Vector3d operator*(const Eigen::Vector3d& x) const { return rotation * x + translation; }
  // Returns the transform from "to" back to "from". `rotation` must have length 1.
  Pose Inverse() const { return {rotation.conjugate(), -(rotation.conjugate() * translation)}; }
};

// A capture and its model have coordinates relative to an origin. Single precision holds seven
// digits, too few to resolve a scene whose coordinates are far from zero, such as map coordinates.
// Poses and PLY files that are exported are in the world of the dataset again.

// Returns the origin for a capture with these cameras: the mean of their centres if it is more than
// a hundred times as far from zero as the furthest camera is from the mean, else zero.
Eigen::Vector3d OriginOf(std::span<const Pose> cams_from_world);

// Converts a pose of a camera in the world to coordinates relative to `origin`, and back.
Pose RelativeTo(const Eigen::Vector3d& origin, const Pose& cam_from_world);
Pose InWorld(const Eigen::Vector3d& origin, const Pose& cam_from_origin);

// Returns the camera of the same field of view in an image of another size. Each side has a scale
// of its own.
Camera Resized(const Camera& camera, int width, int height);

// Returns the indices, y * width + x, of the centres of a regular grid of square cells, as fine as
// `max_cells` allows. Partial cells at the border may bring the count slightly above `max_cells`.
std::vector<int32_t> GridPixels(const Camera& camera, double max_cells);

// Returns camera and pose in the backend's form: single precision, row-major.
PinholeView ToPinholeView(const Camera& camera, const Pose& cam_from_world);

}  // namespace pepeseg
