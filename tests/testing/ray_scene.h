#pragma once

#include <Eigen/Core>
#include <limits>
#include <span>
#include <vector>

#include "core/scene/capture.h"

namespace pepeseg::testing {

// A ray tracer for captures whose ground truth is known exactly. World: x right, y down, z away
// from the viewer.
struct Surface {
  int label;
  bool is_ball;                  // false: a box
  Eigen::Vector3d center, half;  // half sizes; for a ball half.x() is the radius
  Eigen::Vector3d color;
  double contrast = 0.15;                                         // contrast of the texture
  Eigen::Matrix3d axes_from_world = Eigen::Matrix3d::Identity();  // rotation to a box's own axes
};

struct Ray {
  Eigen::Vector3d origin, direction;
};

struct Hit {
  double distance = std::numeric_limits<double>::infinity();  // in lengths of Ray::direction
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  const Surface* surface = nullptr;  // one of the traced surfaces; null: the sky
};

// Returns the first hit of a ray.
Hit Trace(std::span<const Surface> surfaces, const Ray& ray);

// Returns the ray through the point (x, y) of the picture. Its direction is 1 long along the
// camera's axis, so that distances are depths.
Ray PixelRay(const View& view, double x, double y);

// Views on an arc in front of a target, alternating between three heights.
struct ViewArc {
  int num_views = 0, width = 0, height = 0;
  int held_out_every = 0;  // holds out the first view and every n-th after it; 0: none
  double angle = 0;        // angle of the whole arc, radians
  double distance = 4;     // distance from the views to the target along the ground
  Eigen::Vector3d target = Eigen::Vector3d::Zero();
};
View PlaceView(const ViewArc& arc, int index);

// Renders a photograph with four rays a pixel: smooth textures on Lambertian surfaces, under one
// lamp.
Image Photograph(std::span<const Surface> surfaces, const View& view);

// Returns the hit of each pixel's centre, [height, width].
std::vector<Hit> TraceCenters(std::span<const Surface> surfaces, const View& view);

// Returns `num_points` coloured points on the surfaces, which the views see in turn at pixels
// spread over the picture.
std::vector<ScenePoint> SurfacePoints(std::span<const Surface> surfaces, const Capture& capture,
                                      int num_points);

}  // namespace pepeseg::testing
