#include "core/sfm/mapper/absolute_pose.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

#include "core/sfm/two_view/lo_ransac.h"
#include "core/sfm/two_view/point_pair.h"
#include "core/sfm/two_view/relative_pose.h"

namespace pepeseg {
namespace {

constexpr double kConfidence = 0.9999;  // of a sample without outliers
constexpr int kRefinements = 4;         // of a best pose; its inliers change between them
constexpr size_t kFewestFitting = 4;    // three fit by themselves

// Returns the real roots of a polynomial of degree four, as the eigenvalues of its companion
// matrix.
std::vector<double> RealRoots(const std::array<double, 5>& coefficients) {
  const double lead = coefficients[4];
  if (!(std::abs(lead) > 1e-12)) return {};
  Eigen::Matrix4d companion = Eigen::Matrix4d::Zero();
  companion.bottomLeftCorner<3, 3>().setIdentity();
  for (int i = 0; i < 4; ++i) companion(i, 3) = -coefficients[i] / lead;
  const Eigen::EigenSolver<Eigen::Matrix4d> solver(companion, false);
  if (solver.info() != Eigen::Success) return {};
  std::vector<double> roots;
  for (const std::complex<double>& root : solver.eigenvalues()) {
    // Double roots come out with a small imaginary part.
    if (std::abs(root.imag()) < 1e-5 * (1 + std::abs(root.real()))) roots.push_back(root.real());
  }
  return roots;
}

// Returns the pose that moves world points to points of the camera.
CameraPose PoseOf(const Eigen::Matrix3d& world, const Eigen::Matrix3d& camera) {
  const Eigen::Matrix4d motion = Eigen::umeyama(world, camera, false);
  return {motion.topLeftCorner<3, 3>(), motion.topRightCorner<3, 1>(), true};
}

// Returns the squared distance between a sighting and the image of its point.
double SquaredError(const CameraPose& pose, const PointSighting& sighting) {
  const Eigen::Vector3d seen = pose.ToCamera(sighting.point);
  if (!(seen.z() > 1e-9)) return INFINITY;
  return (seen.head<2>() / seen.z() - sighting.seen).squaredNorm();
}

class AbsolutePoseSearch {
 public:
  AbsolutePoseSearch(std::span<const PointSighting> sightings, const AbsolutePoseOptions& options)
      : sightings_(sightings), options_(options), limit_(options.max_error * options.max_error) {}

  std::optional<AbsolutePose> Run();

 private:
  std::vector<uint32_t> Inliers(const CameraPose& pose) const;
  // Sums the squared errors of inliers and the limit of the others, in units of the limit.
  double Loss(const CameraPose& pose) const;
  CameraPose Refined(CameraPose pose) const;
  // Makes a pose the best one if its loss is smaller. Returns whether it is.
  bool Try(const CameraPose& pose);

  std::span<const PointSighting> sightings_;
  const AbsolutePoseOptions& options_;
  double limit_;
  CameraPose best_;
  double best_loss_ = INFINITY;
};

std::vector<uint32_t> AbsolutePoseSearch::Inliers(const CameraPose& pose) const {
  std::vector<uint32_t> inliers;
  for (uint32_t i = 0; i < sightings_.size(); ++i) {
    if (SquaredError(pose, sightings_[i]) < limit_) inliers.push_back(i);
  }
  return inliers;
}

double AbsolutePoseSearch::Loss(const CameraPose& pose) const {
  double sum = 0;
  for (const PointSighting& sighting : sightings_) {
    sum += std::min(1.0, SquaredError(pose, sighting) / limit_);
  }
  return sum;
}

// One Gauss-Newton step over the inliers at a time.
CameraPose AbsolutePoseSearch::Refined(CameraPose pose) const {
  for (int step = 0; step < kRefinements; ++step) {
    Eigen::Matrix<double, 6, 6> matrix = Eigen::Matrix<double, 6, 6>::Identity() * 1e-12;
    Eigen::Matrix<double, 6, 1> right = Eigen::Matrix<double, 6, 1>::Zero();
    for (const uint32_t i : Inliers(pose)) {
      const Eigen::Vector3d turned = pose.rotation * sightings_[i].point;
      const Eigen::Vector3d seen = turned + pose.translation;
      const Eigen::Vector2d u = seen.head<2>() / seen.z();
      Eigen::Matrix<double, 2, 3> by_seen;
      by_seen << Eigen::Matrix2d::Identity() / seen.z(), -u / seen.z();
      Eigen::Matrix<double, 2, 6> by_pose;
      for (int row = 0; row < 2; ++row) {
        by_pose.row(row) << turned.cross(by_seen.row(row).transpose()).transpose(),
            by_seen.row(row);
      }
      matrix += by_pose.transpose() * by_pose;
      right += by_pose.transpose() * (sightings_[i].seen - u);
    }
    const Eigen::Matrix<double, 6, 1> update = matrix.ldlt().solve(right);
    if (!update.allFinite()) break;
    pose.rotation = RotationFromVector(update.head<3>()) * pose.rotation;
    pose.translation += update.tail<3>();
  }
  return pose;
}

bool AbsolutePoseSearch::Try(const CameraPose& pose) {
  const double loss = Loss(pose);
  if (!(loss < best_loss_)) return false;
  best_ = pose;
  best_loss_ = loss;
  return true;
}

std::optional<AbsolutePose> AbsolutePoseSearch::Run() {
  if (sightings_.size() < kFewestFitting) return std::nullopt;
  SeededDraws draws(options_.seed);
  const auto count = static_cast<uint32_t>(sightings_.size());
  double num_needed = options_.max_trials;
  for (int trial = 0; trial < options_.max_trials && trial < num_needed; ++trial) {
    const std::array<uint32_t, 3> i = {draws.Below(count), draws.Below(count), draws.Below(count)};
    if (i[0] == i[1] || i[0] == i[2] || i[1] == i[2]) continue;
    const std::array<PointSighting, 3> sample = {sightings_[i[0]], sightings_[i[1]],
                                                 sightings_[i[2]]};
    bool improved = false;
    for (const CameraPose& pose : SolveThreePoints(sample)) improved = Try(pose) || improved;
    if (!improved) continue;
    Try(Refined(best_));
    const double share = static_cast<double>(Inliers(best_).size()) / count;
    num_needed = NumTrials(share, 3, kConfidence);
  }
  if (!(best_loss_ < INFINITY)) return std::nullopt;
  Try(Refined(best_));
  AbsolutePose found{best_, Inliers(best_)};
  if (found.inliers.size() < kFewestFitting) return std::nullopt;
  return found;
}

}  // namespace

std::vector<CameraPose> SolveThreePoints(std::span<const PointSighting, 3> sightings) {
  Eigen::Matrix3d world, rays;
  for (int i = 0; i < 3; ++i) {
    world.col(i) = sightings[i].point;
    rays.col(i) = sightings[i].seen.homogeneous().normalized();
  }
  const double aa = (world.col(1) - world.col(2)).squaredNorm();
  const double bb = (world.col(0) - world.col(2)).squaredNorm();
  const double cc = (world.col(0) - world.col(1)).squaredNorm();
  const double area =
      (world.col(1) - world.col(0)).cross(world.col(2) - world.col(0)).squaredNorm();
  if (!(area > 1e-12 * bb * cc)) return {};
  const double cos_a = rays.col(1).dot(rays.col(2)), cos_b = rays.col(0).dot(rays.col(2));
  const double cos_c = rays.col(0).dot(rays.col(1));
  // Coefficients of the quartic in v, the third distance over the first one.
  const double minus = (aa - cc) / bb, plus = (aa + cc) / bb, a = aa / bb, c = cc / bb;
  const std::array<double, 5> coefficients = {
      (1 + minus) * (1 + minus) - 4 * a * cos_c * cos_c,
      4 * (-minus * (1 + minus) * cos_b + 2 * a * cos_c * cos_c * cos_b -
           (1 - plus) * cos_a * cos_c),
      2 * (minus * minus - 1 + 2 * minus * minus * cos_b * cos_b + 2 * (1 - c) * cos_a * cos_a -
           4 * plus * cos_a * cos_b * cos_c + 2 * (1 - a) * cos_c * cos_c),
      4 * (minus * (1 - minus) * cos_b - (1 - plus) * cos_a * cos_c +
           2 * c * cos_a * cos_a * cos_b),
      (minus - 1) * (minus - 1) - 4 * c * cos_a * cos_a};
  std::vector<CameraPose> poses;
  for (const double v : RealRoots(coefficients)) {
    const double denominator = 2 * (cos_c - v * cos_a);
    if (!(v > 0) || !(std::abs(denominator) > 1e-12)) continue;
    const double u = ((minus - 1) * v * v - 2 * minus * cos_b * v + 1 + minus) / denominator;
    const double first_squared = bb / (1 + v * v - 2 * v * cos_b);
    if (!(u > 0) || !(first_squared > 0)) continue;
    const double first = std::sqrt(first_squared);
    Eigen::Matrix3d camera = rays;
    camera.col(0) *= first, camera.col(1) *= u * first, camera.col(2) *= v * first;
    const CameraPose pose = PoseOf(world, camera);
    if (pose.rotation.allFinite() && pose.translation.allFinite()) poses.push_back(pose);
  }
  return poses;
}

std::optional<AbsolutePose> EstimateAbsolutePose(std::span<const PointSighting> sightings,
                                                 const AbsolutePoseOptions& options) {
  return AbsolutePoseSearch(sightings, options).Run();
}

}  // namespace pepeseg
