#include "core/scene/origin.h"

#include <algorithm>

namespace pepeseg {

Eigen::Vector3d OriginOf(std::span<const Pose> cams_from_world) {
  constexpr double kFar = 100;  // spreads
  if (cams_from_world.empty()) return Eigen::Vector3d::Zero();
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
  const Eigen::Quaterniond rotation = cam_from_world.rotation.normalized();
  return {cam_from_world.rotation, rotation * origin + cam_from_world.translation};
}

Pose InWorld(const Eigen::Vector3d& origin, const Pose& cam_from_origin) {
  return RelativeTo(-origin, cam_from_origin);
}

}  // namespace pepeseg
