#include "core/sfm/two_view/relative_pose.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

namespace pepeseg {
namespace {

using Matrix5d = Eigen::Matrix<double, 5, 5>;
using Vector5d = Eigen::Matrix<double, 5, 1>;

Eigen::Matrix3d Cross(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

// Moves a pose by a rotation vector (0 to 2) and along two directions normal to its translation.
RelativePose Moved(const RelativePose& pose, const Vector5d& step,
                   const Eigen::Matrix<double, 3, 2>& tangents) {
  return {RotationFromVector(step.head<3>()) * pose.rotation,
          (pose.translation + tangents * step.tail<2>()).normalized()};
}

Eigen::Matrix<double, 3, 2> TangentsOf(const Eigen::Vector3d& unit) {
  Eigen::Matrix<double, 3, 2> tangents;
  tangents.col(0) = unit.unitOrthogonal();
  tangents.col(1) = unit.cross(tangents.col(0));
  return tangents;
}

double WeightedError(const RelativePose& pose, std::span<const PointPair> pairs,
                     std::span<const double> weights) {
  const Eigen::Matrix3d essential = EssentialMatrix(pose);
  double sum = 0;
  for (size_t i = 0; i < pairs.size(); ++i) {
    if (weights[i] > 0) sum += weights[i] * SampsonSquared(essential, pairs[i]);
  }
  return sum;
}

// Sums the normal equations of the weighted Sampson distances.
void AddNormalEquations(const RelativePose& pose, std::span<const PointPair> pairs,
                        std::span<const double> weights,
                        const Eigen::Matrix<double, 3, 2>& tangents, Matrix5d& hessian,
                        Vector5d& gradient) {
  const Eigen::Matrix3d essential = EssentialMatrix(pose), cross = Cross(pose.translation);
  Eigen::Matrix3d derivatives[5];
  for (int k = 0; k < 3; ++k) {
    derivatives[k] = cross * Cross(Eigen::Vector3d::Unit(k)) * pose.rotation;
  }
  for (int k = 0; k < 2; ++k) derivatives[3 + k] = Cross(tangents.col(k)) * pose.rotation;
  for (size_t i = 0; i < pairs.size(); ++i) {
    if (!(weights[i] > 0)) continue;
    const Eigen::Vector3d first = pairs[i].first.homogeneous();
    const Eigen::Vector3d second = pairs[i].second.homogeneous();
    const Eigen::Vector3d line = essential * first;
    const Eigen::Vector2d back = (essential.transpose() * second).head<2>();
    const double squared = line.head<2>().squaredNorm() + back.squaredNorm();
    if (!(squared > 0)) continue;
    const double length = std::sqrt(squared), residual = second.dot(line) / length;
    Vector5d row;
    for (int k = 0; k < 5; ++k) {
      const Eigen::Vector3d moved = derivatives[k] * first;
      const Eigen::Vector2d moved_back = (derivatives[k].transpose() * second).head<2>();
      const double change = line.head<2>().dot(moved.head<2>()) + back.dot(moved_back);
      row[k] = second.dot(moved) / length - residual * change / squared;
    }
    hessian += weights[i] * row * row.transpose();
    gradient += weights[i] * residual * row;
  }
}

// Returns how many pairs are in front of both cameras: the signs of their two depths.
int NumInFront(const RelativePose& pose, std::span<const PointPair> pairs) {
  int count = 0;
  for (const PointPair& pair : pairs) {
    // depth2 v = depth1 R u + t, solved for both depths in the least squares sense.
    const Eigen::Vector3d u = pose.rotation * pair.first.homogeneous();
    const Eigen::Vector3d v = pair.second.homogeneous();
    const double uu = u.squaredNorm(), vv = v.squaredNorm(), uv = u.dot(v);
    const double ut = u.dot(pose.translation), vt = v.dot(pose.translation);
    if (uv * vt - vv * ut > 0 && uu * vt - uv * ut > 0) ++count;
  }
  return count;
}

}  // namespace

Eigen::Matrix3d EssentialMatrix(const RelativePose& pose) {
  return Cross(pose.translation) * pose.rotation;
}

Eigen::Matrix3d RotationFromVector(const Eigen::Vector3d& vector) {
  const double angle = vector.norm();
  if (angle < 1e-12) return Eigen::Matrix3d::Identity() + Cross(vector);
  return Eigen::AngleAxisd(angle, vector / angle).toRotationMatrix();
}

Eigen::Vector3d VectorFromRotation(const Eigen::Matrix3d& rotation) {
  const Eigen::AngleAxisd turn(rotation);
  return turn.angle() * turn.axis();
}

double RotationAngle(const Eigen::Matrix3d& rotation) {
  const Eigen::Vector3d axis(rotation(2, 1) - rotation(1, 2), rotation(0, 2) - rotation(2, 0),
                             rotation(1, 0) - rotation(0, 1));
  return std::atan2(axis.norm(), rotation.trace() - 1);
}

std::optional<CheiralPose> DecomposeEssential(const Eigen::Matrix3d& essential,
                                              std::span<const PointPair> pairs) {
  if (!essential.allFinite()) return std::nullopt;
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(essential, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d u = svd.matrixU(), v = svd.matrixV();
  if (u.determinant() < 0) u = -u;
  if (v.determinant() < 0) v = -v;
  Eigen::Matrix3d w;
  w << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  CheiralPose best;
  for (const Eigen::Matrix3d& turn : {w, Eigen::Matrix3d(w.transpose())}) {
    for (const double sign : {1.0, -1.0}) {
      const RelativePose pose{u * turn * v.transpose(), sign * u.col(2)};
      const int count = NumInFront(pose, pairs);
      if (count > best.num_in_front) best = {pose, count};
    }
  }
  if (best.num_in_front == 0) return std::nullopt;
  return best;
}

RelativePose RefineRelativePose(const RelativePose& pose, std::span<const PointPair> pairs,
                                std::span<const double> weights, int num_steps) {
  RelativePose best = pose;
  double best_error = WeightedError(best, pairs, weights), damping = 1e-6;
  for (int step = 0; step < num_steps; ++step) {
    const Eigen::Matrix<double, 3, 2> tangents = TangentsOf(best.translation);
    Matrix5d hessian = Matrix5d::Zero();
    Vector5d gradient = Vector5d::Zero();
    AddNormalEquations(best, pairs, weights, tangents, hessian, gradient);
    hessian.diagonal() += damping * hessian.diagonal() + Vector5d::Constant(1e-15);
    const Vector5d change = -hessian.ldlt().solve(gradient);
    if (!change.allFinite()) break;
    const RelativePose moved = Moved(best, change, tangents);
    const double error = WeightedError(moved, pairs, weights);
    if (!(error < best_error)) {
      damping = std::max(damping * 100, 1e-4);
      if (damping > 1e4) break;
      continue;
    }
    const bool done = error > best_error * (1 - 1e-9);
    best = moved, best_error = error, damping /= 10;
    if (done) break;
  }
  return best;
}

}  // namespace pepeseg
