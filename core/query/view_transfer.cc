#include "core/query/view_transfer.h"

#include <Eigen/Core>
#include <cmath>
#include <cstddef>

namespace pepeseg {
namespace {

constexpr double kSameDepth = 0.03;  // relative difference of depths of one surface

}  // namespace

TransferredMap TransferMap(const ViewDepth& from, std::span<const uint8_t> map,
                           const ViewDepth& to) {
  const Camera& source = from.view.camera;
  const Camera& target = to.view.camera;
  const Pose& source_pose = from.view.cam_from_world;
  const Pose source_from_target = {
      source_pose.rotation * to.view.cam_from_world.rotation.conjugate(),
      source_pose * (to.view.cam_from_world.Inverse() * Eigen::Vector3d::Zero())};
  const Eigen::Matrix3d rotation = source_from_target.rotation.toRotationMatrix();
  TransferredMap result;
  result.known.resize(to.depth.size());
  result.values.resize(to.depth.size());
  for (int y = 0; y < target.height; ++y) {
    for (int x = 0; x < target.width; ++x) {
      const size_t pixel = static_cast<size_t>(y) * target.width + x;
      const double depth = to.depth[pixel];
      if (!(depth > 0)) continue;
      const Eigen::Vector3d ray((x + 0.5 - target.cx) / target.fx,
                                (y + 0.5 - target.cy) / target.fy, 1);
      const Eigen::Vector3d point = rotation * (depth * ray) + source_from_target.translation;
      if (!(point.z() > 0)) continue;
      const double u = source.fx * point.x() / point.z() + source.cx;
      const double v = source.fy * point.y() / point.z() + source.cy;
      if (!(u >= 0 && u < source.width && v >= 0 && v < source.height)) continue;
      const size_t there = static_cast<size_t>(v) * source.width + static_cast<size_t>(u);
      const double seen = from.depth[there];
      if (!(seen > 0) || std::abs(seen - point.z()) >= kSameDepth * point.z()) continue;
      result.known[pixel] = 1;
      result.values[pixel] = map[there];
    }
  }
  return result;
}

}  // namespace pepeseg
