#include "core/reconstruct/initial_gaussians.h"

#include <algorithm>
#include <cmath>
#include <nanoflann.hpp>

#include "core/base/order_statistics.h"
#include "kernels/math/sh.h"

namespace pepeseg {
namespace {

constexpr float kInitialOpacity = 0.1f;
constexpr float kLoneSize = 0.01f;  // share of the scene's reach, where no neighbour gives a size

// Adapts the points to nanoflann.
struct PointCloud {
  const std::vector<ScenePoint>& points;

  size_t kdtree_get_point_count() const { return points.size(); }
  float kdtree_get_pt(size_t i, size_t axis) const {
    return points[i].position[static_cast<Eigen::Index>(axis)];
  }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};
using KdTree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, PointCloud>,
                                                   PointCloud, 3, uint32_t>;

// Returns the mean distance of each point to its 3 nearest neighbours; 0 for a single point.
std::vector<float> NeighbourDistances(const std::vector<ScenePoint>& points) {
  constexpr int kNumNeighbours = 3;
  const PointCloud cloud = {points};
  const KdTree tree(3, cloud, nanoflann::KDTreeSingleIndexAdaptorParams(16));
  std::vector<float> distances;
  distances.reserve(points.size());
  uint32_t index[kNumNeighbours + 1];
  float squared[kNumNeighbours + 1];
  for (const ScenePoint& point : points) {
    // The first result is the point itself or one at the same place: skip it.
    const size_t found = tree.knnSearch(point.position.data(), kNumNeighbours + 1, index, squared);
    float sum = 0;
    for (size_t k = 1; k < found; ++k) sum += std::sqrt(squared[k]);
    distances.push_back(found > 1 ? sum / static_cast<float>(found - 1) : 0.0f);
  }
  return distances;
}

double Uniform(std::mt19937_64& random) {
  return std::uniform_real_distribution<double>(0, 1)(random);
}

// Returns a point at a random pixel and a log-uniform depth of 0.5 to 10 scene radii.
ScenePoint RandomPoint(const View& view, double scene_radius, std::mt19937_64& random) {
  const Camera& camera = view.camera;
  const double x = Uniform(random) * camera.width, y = Uniform(random) * camera.height;
  // z in the camera's frame. The order of the draws is fixed: x, y, depth.
  const double depth = scene_radius * 0.5 * std::pow(20.0, Uniform(random));
  const Eigen::Vector3d in_cam((x - camera.cx) / camera.fx * depth,
                               (y - camera.cy) / camera.fy * depth, depth);
  ScenePoint point;
  point.position = (view.cam_from_world.Inverse() * in_cam).cast<float>();
  const size_t pixel = static_cast<size_t>(y) * camera.width + static_cast<size_t>(x);
  std::copy_n(view.photo.pixels.data() + 3 * pixel, 3, point.rgb);
  return point;
}

constexpr double kMinShare = 1e-6, kMaxShare = 0.5;  // standard deviations, share of the reach

// Returns the reach that the bounds were made from.
float ReachOf(const LogScaleBounds& bounds) {
  return static_cast<float>(std::exp(double{bounds.max}) / kMaxShare);
}

Eigen::Vector3d CenterOfCameras(const Capture& capture) {
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  for (const View& view : capture.views) center += view.cam_from_world.Inverse().translation;
  return center / static_cast<double>(capture.views.size());
}

// Returns how far the scene reaches from its cameras: the larger of its radius and the distance of
// the points.
double Reach(const Capture& capture, const std::vector<ScenePoint>& points) {
  const Eigen::Vector3d center = CenterOfCameras(capture);
  std::vector<double> distances;
  distances.reserve(points.size());
  for (const ScenePoint& point : points) {
    distances.push_back((point.position.cast<double>() - center).norm());
  }
  // The 90th percentile, because points far out are often wrong.
  return std::max(SceneRadius(capture), ValueAtRank(distances, distances.size() * 9 / 10));
}

}  // namespace

LogScaleBounds BoundLogScales(const Capture& capture, const std::vector<ScenePoint>& points) {
  const double reach = Reach(capture, points);
  return {static_cast<float>(std::log(kMinShare * reach)),
          static_cast<float>(std::log(kMaxShare * reach))};
}

// Draws nothing from `random` where the capture has points. Random points go round the training
// views in turn.
std::vector<ScenePoint> StartingPoints(const Capture& capture, const ReconstructOptions& options,
                                       std::mt19937_64& random) {
  std::vector<ScenePoint> points;
  if (!capture.points.empty()) {
    const auto most = static_cast<size_t>(options.max_gaussians);
    // Every n-th point instead of a draw: the result does not depend on the seed.
    const size_t stride = (capture.points.size() + most - 1) / most;
    // A point from a wrong match may be anywhere. A Gaussian there would never be moved or pruned.
    constexpr double kFarthest = 1000;  // in reaches
    const Eigen::Vector3d center = CenterOfCameras(capture);
    const double farthest = kFarthest * Reach(capture, capture.points);
    for (size_t i = 0; i < capture.points.size(); i += stride) {
      const double distance = (capture.points[i].position.cast<double>() - center).norm();
      if (distance <= farthest) points.push_back(capture.points[i]);
    }
    return points;
  }
  std::vector<const View*> views;
  for (const View& view : capture.views) {
    if (!view.held_out) views.push_back(&view);
  }
  const double scene_radius = SceneRadius(capture);
  const int64_t count = std::min(options.num_random_points, options.max_gaussians);
  for (int64_t i = 0; i < count; ++i) {
    points.push_back(RandomPoint(*views[i % views.size()], scene_radius, random));
  }
  return points;
}

// Colours are stored as spherical harmonics: c = 0.5 + kSh0 * coefficient. Scales and opacities are
// stored as logarithms and logits; the rotation (1, 0, 0, 0) is the identity.
Gaussians InitialGaussians(const std::vector<ScenePoint>& points, int sh_degree,
                           const LogScaleBounds& bounds) {
  const std::vector<float> distances = NeighbourDistances(points);
  const float lone = kLoneSize * ReachOf(bounds);
  Gaussians out = Gaussians::Zero(static_cast<int64_t>(points.size()), sh_degree);
  for (int64_t i = 0; i < out.count; ++i) {
    const float size = distances[i] > 0 ? distances[i] : lone;
    // A sphere as large as the mean distance to the 3 nearest points, as in 3DGS.
    const float log_scale = std::clamp(std::log(size), bounds.min, bounds.max);
    for (int axis = 0; axis < 3; ++axis) {
      out.Plane(kMeanPlane + axis)[i] = points[i].position[axis];
      out.Plane(kLogScalePlane + axis)[i] = log_scale;
      out.Plane(kShPlane + axis)[i] = (static_cast<float>(points[i].rgb[axis]) / 255 - 0.5f) / kSh0;
    }
    out.Plane(kRotationPlane)[i] = 1;
    out.Plane(kOpacityPlane)[i] = std::log(kInitialOpacity / (1 - kInitialOpacity));
  }
  return out;
}

}  // namespace pepeseg
