#include "core/reconstruct/capture_kind.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace pepeseg {

// A view looks along +z of its camera; the inverse rotation takes that into the world.
double ViewingSpread(const Capture& capture) {
  std::vector<Eigen::Vector3d> directions;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const View& view : capture.views) {
    if (view.held_out) continue;
    directions.emplace_back(view.cam_from_world.rotation.conjugate() * Eigen::Vector3d::UnitZ());
    sum += directions.back();
  }
  if (directions.empty()) return 0;
  constexpr double kCancelled = 1e-6;  // share of the length that equal directions would have
  const auto num = static_cast<double>(directions.size());
  if (sum.norm() < kCancelled * num) return 180;
  const Eigen::Vector3d mean = sum.normalized();
  double squares = 0;
  for (const Eigen::Vector3d& direction : directions) {
    const double angle = std::acos(std::clamp(direction.dot(mean), -1.0, 1.0));
    squares += angle * angle / num;
  }
  return std::sqrt(squares) * 180 / std::numbers::pi;
}

CaptureKind FindCaptureKind(const Capture& capture) {
  return ViewingSpread(capture) < kForwardFacingSpread ? CaptureKind::kForwardFacing
                                                       : CaptureKind::kOrbit;
}

}  // namespace pepeseg
