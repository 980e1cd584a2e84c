#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

#include "core/sfm/two_view/point_pair.h"

namespace pepeseg {

// Pose of the second camera relative to the first one: X' = rotation X + translation.
struct RelativePose {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();  // of length 1
};

// Returns [translation]x rotation.
Eigen::Matrix3d EssentialMatrix(const RelativePose& pose);

// Returns the rotation by a vector's length (radians) about its direction.
Eigen::Matrix3d RotationFromVector(const Eigen::Vector3d& vector);
// Returns the vector of a rotation, of length at most pi.
Eigen::Vector3d VectorFromRotation(const Eigen::Matrix3d& rotation);
// Returns the angle of a rotation, radians.
double RotationAngle(const Eigen::Matrix3d& rotation);

// Returns the squared Sampson distance of a pair from second' F first = 0, or NaN where it is not
// defined (Hartley and Zisserman 2003, 11.4.3).
inline double SampsonSquared(const Eigen::Matrix3d& f, const PointPair& pair) {
  const double x = pair.first.x(), y = pair.first.y(), u = pair.second.x(), v = pair.second.y();
  const double a = f(0, 0) * x + f(0, 1) * y + f(0, 2), b = f(1, 0) * x + f(1, 1) * y + f(1, 2);
  const double c = f(2, 0) * x + f(2, 1) * y + f(2, 2);
  const double d = f(0, 0) * u + f(1, 0) * v + f(2, 0), e = f(0, 1) * u + f(1, 1) * v + f(2, 1);
  const double n = u * a + v * b + c;
  return n * n / (a * a + b * b + d * d + e * e);
}

// Returns which of the four poses of an essential matrix has most of the pairs (normalised
// coordinates) in front of both cameras, with their number; nothing if none has any.
struct CheiralPose {
  RelativePose pose;
  int num_in_front = 0;
};
std::optional<CheiralPose> DecomposeEssential(const Eigen::Matrix3d& essential,
                                              std::span<const PointPair> pairs);

// Minimises the sum of weights times squared Sampson distances over the pose's five parameters with
// `num_steps` damped Gauss-Newton steps. Pairs in normalised coordinates, a weight for each.
RelativePose RefineRelativePose(const RelativePose& pose, std::span<const PointPair> pairs,
                                std::span<const double> weights, int num_steps);

}  // namespace pepeseg
