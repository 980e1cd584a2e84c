#include "tests/testing/align_centers.h"

#include <Eigen/Geometry>
#include <cassert>
#include <cmath>

namespace pepeseg::testing {
namespace {

Eigen::Matrix3Xd Columns(std::span<const Eigen::Vector3d> points) {
  Eigen::Matrix3Xd columns(3, points.size());
  for (size_t i = 0; i < points.size(); ++i) {
    columns.col(static_cast<Eigen::Index>(i)) = points[i];
  }
  return columns;
}

}  // namespace

double CenterError(std::span<const Eigen::Vector3d> estimated,
                   std::span<const Eigen::Vector3d> truth) {
  assert(estimated.size() == truth.size() && truth.size() >= 3);
  const Eigen::Matrix3Xd from = Columns(estimated), to = Columns(truth);
  const Eigen::Matrix4d similarity = Eigen::umeyama(from, to, /*with_scaling=*/true);
  const Eigen::Matrix3Xd moved =
      (similarity.topLeftCorner<3, 3>() * from).colwise() + similarity.topRightCorner<3, 1>();
  const Eigen::Vector3d mean = to.rowwise().mean();
  return std::sqrt((moved - to).squaredNorm() / (to.colwise() - mean).squaredNorm());
}

}  // namespace pepeseg::testing
