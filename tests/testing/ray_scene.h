#pragma once

#include <Eigen/Core>
#include <limits>
#include <span>
#include <vector>

#include "core/scene/capture.h"

namespace pepeseg::testing {

// A ray tracer for captures whose truth is known exactly. World: x right, y down, z away from the
// viewer.
struct Surface {
  int label;
  bool is_ball;                  // else a box
  Eigen::Vector3d center, half;  // half sizes; for a ball half.x() is the radius
  Eigen::Vector3d color;
  double contrast = 0.15;                                         // of the texture
  Eigen::Matrix3d axes_from_world = Eigen::Matrix3d::Identity();  // rotation to a box's own axes
};

struct Ray {
  Eigen::Vector3d origin, direction;
};

struct Hit {
  double distance = std::numeric_limits<double>::infinity();  // in lengths of the direction
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  const Surface* surface = nullptr;  // of those that were traced; null: the sky
};

Hit Trace(std::span<const Surface> surfaces, const Ray& ray);

// Through the point (x, y) of the picture; 1 along the camera's axis, so that distances are depths.
Ray PixelRay(const View& view, double x, double y);

// Views from an arc in front of a target, at three heights in turn.
struct ViewArc {
  int num_views = 0, width = 0, height = 0;
  int held_out_every = 0;  // from the first; 0: none
  double angle = 0;        // of the whole arc
  double distance = 4;     // of the views, along the ground
  Eigen::Vector3d target = Eigen::Vector3d::Zero();
};
View PlaceView(const ViewArc& arc, int index);

// Four rays a pixel: smooth textures fixed to the surfaces, Lambertian under one lamp.
Image Photograph(std::span<const Surface> surfaces, const View& view);

// [height, width], of the pixels' centres.
std::vector<Hit> TraceCenters(std::span<const Surface> surfaces, const View& view);

// Coloured points at spread-out pixels of the views in turn.
std::vector<ScenePoint> SurfacePoints(std::span<const Surface> surfaces, const Capture& capture,
                                      int num_points);

}  // namespace pepeseg::testing
