#include "core/scene/capture.h"

#include <algorithm>

namespace pepeseg {

double SceneRadius(const Capture& capture) {
  constexpr double kMargin = 1.1;
  constexpr double kSmallest = 1e-6;
  if (capture.views.empty()) return kSmallest;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const View& view : capture.views) mean += view.cam_from_world.Inverse().translation;
  mean /= static_cast<double>(capture.views.size());
  double radius = 0;
  for (const View& view : capture.views) {
    radius = std::max(radius, (view.cam_from_world.Inverse().translation - mean).norm());
  }
  return std::max(kMargin * radius, kSmallest);
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
