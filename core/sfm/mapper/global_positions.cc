#include "core/sfm/mapper/global_positions.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "core/sfm/two_view/point_pair.h"

namespace pepeseg {
namespace {

// State of one run.
class PositionSearch {
 public:
  PositionSearch(int num_cameras, int num_points, std::span<const WorldRay> rays,
                 const PositionOptions& options)
      : rays_(rays), options_(options) {
    SeededDraws draws(options.seed);
    const auto random = [&] {
      const double x = draws.Unit(), y = draws.Unit(), z = draws.Unit();
      return Eigen::Vector3d(2 * x - 1, 2 * y - 1, 2 * z - 1);
    };
    for (int i = 0; i < num_cameras; ++i) cameras_.push_back(random());
    for (int i = 0; i < num_points; ++i) points_.push_back(random());
    factors_.assign(rays.size(), 1.0);
    begin_.assign(num_points + 1, 0);
    for (const WorldRay& ray : rays) ++begin_[ray.point + 1];
    for (int p = 0; p < num_points; ++p) begin_[p + 1] += begin_[p];
  }

  GlobalPositions Run();

 private:
  // Remainder of a point after elimination, for the back substitution.
  struct PointBlock {
    Eigen::Matrix3d inverse;
    Eigen::Vector3d gradient;
  };

  double Huber(double squared) const {
    const double size = std::sqrt(squared), h = options_.huber;
    return size <= h ? squared : 2 * h * size - h * h;
  }
  double Cost() const;
  // Builds the camera equations with all factors and points eliminated, and solves them.
  bool Solve(double damping, Eigen::VectorXd& step, std::vector<PointBlock>& blocks);
  void Apply(const Eigen::VectorXd& step, const std::vector<PointBlock>& blocks, double damping);

  std::span<const WorldRay> rays_;
  PositionOptions options_;
  std::vector<Eigen::Vector3d> cameras_, points_;
  std::vector<double> factors_;
  std::vector<uint32_t> begin_;  // first ray of each point
  // For each ray, with its factor eliminated: curvature and gradient in X - c.
  std::vector<Eigen::Matrix3d> curvature_;
  std::vector<Eigen::Vector3d> gradient_;
};

double PositionSearch::Cost() const {
  double sum = 0;
  for (size_t i = 0; i < rays_.size(); ++i) {
    const WorldRay& ray = rays_[i];
    const Eigen::Vector3d offset = points_[ray.point] - cameras_[ray.camera];
    sum += Huber((ray.direction - factors_[i] * offset).squaredNorm());
  }
  return sum;
}

bool PositionSearch::Solve(double damping, Eigen::VectorXd& step, std::vector<PointBlock>& blocks) {
  const auto size = static_cast<Eigen::Index>(3 * cameras_.size());
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(size, size);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(size);
  curvature_.resize(rays_.size());
  gradient_.resize(rays_.size());
  blocks.resize(points_.size());
  for (size_t p = 0; p < points_.size(); ++p) {
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
    for (uint32_t i = begin_[p]; i < begin_[p + 1]; ++i) {
      const Eigen::Vector3d u = points_[p] - cameras_[rays_[i].camera];
      const double d = factors_[i];
      const Eigen::Vector3d residual = rays_[i].direction - d * u;
      const double length = residual.norm();
      const double weight = length <= options_.huber ? 1 : options_.huber / length;
      // The factor's own curvature is w u'u (1 + damping); it takes its share of X - c.
      const double uu = u.squaredNorm(), own = uu * (1 + damping) + 1e-12;
      curvature_[i] =
          weight * d * d * ((1 + damping) * Eigen::Matrix3d::Identity() - u * u.transpose() / own);
      gradient_[i] = -weight * d * (residual - u * (u.dot(residual) / own));
      sum += curvature_[i];
      gradient += gradient_[i];
    }
    sum.diagonal().array() += 1e-12;
    blocks[p] = {sum.inverse(), gradient};
    for (uint32_t i = begin_[p]; i < begin_[p + 1]; ++i) {
      const Eigen::Index a = 3 * rays_[i].camera;
      matrix.block<3, 3>(a, a) += curvature_[i];
      const Eigen::Matrix3d reach = curvature_[i] * blocks[p].inverse;
      right.segment<3>(a) += gradient_[i] - reach * gradient;
      for (uint32_t j = begin_[p]; j < begin_[p + 1]; ++j) {
        const Eigen::Index b = 3 * rays_[j].camera;
        if (b <= a) matrix.block<3, 3>(a, b) -= reach * curvature_[j];
      }
    }
  }
  matrix.diagonal().array() += 1e-9;
  const Eigen::LDLT<Eigen::MatrixXd> solver(matrix);
  if (solver.info() != Eigen::Success) return false;
  step = solver.solve(right);
  return step.allFinite();
}

void PositionSearch::Apply(const Eigen::VectorXd& step, const std::vector<PointBlock>& blocks,
                           double damping) {
  for (size_t p = 0; p < points_.size(); ++p) {
    Eigen::Vector3d pulled = -blocks[p].gradient;
    for (uint32_t i = begin_[p]; i < begin_[p + 1]; ++i) {
      pulled += curvature_[i] * step.segment<3>(3 * rays_[i].camera);
    }
    const Eigen::Vector3d moved = blocks[p].inverse * pulled;
    for (uint32_t i = begin_[p]; i < begin_[p + 1]; ++i) {
      const Eigen::Vector3d u = points_[p] - cameras_[rays_[i].camera];
      const Eigen::Vector3d shift = moved - step.segment<3>(3 * rays_[i].camera);
      const Eigen::Vector3d residual = rays_[i].direction - factors_[i] * u;
      const double own = u.squaredNorm() * (1 + damping) + 1e-12;
      factors_[i] = std::max(1e-5, factors_[i] + u.dot(residual - factors_[i] * shift) / own);
    }
    points_[p] += moved;
  }
  for (size_t c = 0; c < cameras_.size(); ++c) cameras_[c] += step.segment<3>(3 * c);
}

GlobalPositions PositionSearch::Run() {
  double damping = 1e-4, cost = Cost();
  int num_flat = 0;
  for (int step = 0; step < options_.max_steps; ++step) {
    Eigen::VectorXd update;
    std::vector<PointBlock> blocks;
    const auto cameras = cameras_, points = points_;
    const auto factors = factors_;
    double moved_cost = INFINITY;
    if (Solve(damping, update, blocks)) {
      Apply(update, blocks, damping);
      moved_cost = Cost();
    }
    if (moved_cost < cost) {
      num_flat = moved_cost > cost * (1 - 1e-5) ? num_flat + 1 : 0;
      cost = moved_cost;
      damping = std::max(damping / 3, 1e-8);
      if (num_flat >= 2) break;
    } else {
      cameras_ = cameras, points_ = points, factors_ = factors;
      damping *= 10;
      if (damping > 1e6) break;
    }
  }
  return {cameras_, points_, cost};
}

}  // namespace

GlobalPositions FindPositions(int num_cameras, int num_points, std::span<const WorldRay> rays,
                              const PositionOptions& options) {
  return PositionSearch(num_cameras, num_points, rays, options).Run();
}

double PositionDifference(std::span<const Eigen::Vector3d> a, std::span<const Eigen::Vector3d> b,
                          const std::vector<bool>& counts) {
  Eigen::Vector3d mean_a = Eigen::Vector3d::Zero(), mean_b = Eigen::Vector3d::Zero();
  double num = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    if (counts[i]) mean_a += a[i], mean_b += b[i], num += 1;
  }
  mean_a /= num, mean_b /= num;
  double aa = 0, bb = 0, ab = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    if (!counts[i]) continue;
    aa += (a[i] - mean_a).squaredNorm(), bb += (b[i] - mean_b).squaredNorm();
    ab += (a[i] - mean_a).dot(b[i] - mean_b);
  }
  // The scale s = ab / bb leaves aa - ab^2 / bb.
  return std::sqrt(std::max(0.0, aa - ab * ab / bb) / aa);
}

}  // namespace pepeseg
