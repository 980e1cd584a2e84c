#include "core/scene/capture.h"

#include <algorithm>

namespace pepeseg {

namespace {

Eigen::Vector3d CenterOf(const View& view) { return view.cam_from_world.Inverse().translation; }

// The median, of every n-th point where there are very many; 0 where there is none.
double DistanceToPoints(const Capture& capture, const Eigen::Vector3d& from) {
  constexpr size_t kMost = 100'000;
  const size_t stride = std::max<size_t>(1, capture.points.size() / kMost);
  std::vector<double> distances;
  for (size_t i = 0; i < capture.points.size(); i += stride) {
    distances.push_back((capture.points[i].position.cast<double>() - from).norm());
  }
  if (distances.empty()) return 0;
  const auto middle = distances.begin() + static_cast<int64_t>(distances.size() / 2);
  std::nth_element(distances.begin(), middle, distances.end());
  return *middle;
}

}  // namespace

double SceneRadius(const Capture& capture) {
  constexpr double kMargin = 1.1;
  constexpr double kOnePlace = 1e-3;   // of the distance to the points: next to no parallax
  constexpr double kRounding = 1e-12;  // of the coordinates
  if (capture.views.empty()) return 1;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const View& view : capture.views) mean += CenterOf(view);
  mean /= static_cast<double>(capture.views.size());
  double radius = 0;
  for (const View& view : capture.views) {
    radius = std::max(radius, (CenterOf(view) - mean).norm());
  }
  const double distance = DistanceToPoints(capture, mean);
  if (distance > 0 && radius < kOnePlace * distance) return distance;
  return radius > kRounding * mean.norm() ? kMargin * radius : 1;
}

bool HasDepthPrior(const View& view) {
  return std::ranges::any_of(view.depth.values, [](float value) { return !std::isnan(value); });
}

bool HasTrainingDepth(const Capture& capture) {
  return std::ranges::any_of(
      capture.views, [](const View& view) { return !view.held_out && HasDepthPrior(view); });
}

bool HasGeometryPrior(const View& view) { return !view.depth.from_points && HasDepthPrior(view); }

bool HasTrainingGeometry(const Capture& capture) {
  return std::ranges::any_of(
      capture.views, [](const View& view) { return !view.held_out && HasGeometryPrior(view); });
}

}  // namespace pepeseg
