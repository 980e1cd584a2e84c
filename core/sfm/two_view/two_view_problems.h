#pragma once

#include <Eigen/Core>
#include <span>

#include "core/sfm/two_view/lo_ransac.h"
#include "core/sfm/two_view/relative_pose.h"

namespace pepeseg {

// What LoRansac solves for two photographs. All keep references to `pairs`, and count residuals in
// the unit of `pairs`; those have a mean of about 0 and a deviation of about 1.

// F with second' F first = 0; residuals are Sampson distances.
class FundamentalProblem {
 public:
  static constexpr size_t kSampleSize = 7;
  using Prepared = Eigen::Matrix3d;

  explicit FundamentalProblem(std::span<const PointPair> pairs) : pairs_(pairs) {}
  size_t size() const { return pairs_.size(); }
  Candidates Solve(std::span<const uint32_t, kSampleSize> sample) const;
  const Prepared& Prepare(const Eigen::Matrix3d& f) const { return f; }
  double Residual(const Prepared& f, uint32_t i) const { return SampsonSquared(f, pairs_[i]); }
  // Weighted 8-point algorithm: algebraic errors divided by the Sampson distance's gradient.
  Eigen::Matrix3d Refine(const Eigen::Matrix3d& f, const MagsacLoss& loss) const;

 private:
  std::span<const PointPair> pairs_;
};

// H with second ~ H first. The residual is the distance to the nearest pair that H maps exactly, to
// first order and for photographs of equal scale: half the root of both squared transfer errors'
// sum.
class HomographyProblem {
 public:
  static constexpr size_t kSampleSize = 4;
  struct Prepared {
    Eigen::Matrix3d forward, backward;
  };

  explicit HomographyProblem(std::span<const PointPair> pairs) : pairs_(pairs) {}
  size_t size() const { return pairs_.size(); }
  Candidates Solve(std::span<const uint32_t, kSampleSize> sample) const;
  Prepared Prepare(const Eigen::Matrix3d& h) const;
  double Residual(const Prepared& h, uint32_t i) const;
  // Weighted direct linear transform.
  Eigen::Matrix3d Refine(const Eigen::Matrix3d& h, const MagsacLoss& loss) const;

 private:
  std::span<const PointPair> pairs_;
};

// E with second' E first = 0 for `normalised` pairs; residuals are Sampson distances of
// F = second_inverse' E first_inverse in the coordinates of `pairs`.
class EssentialProblem {
 public:
  static constexpr size_t kSampleSize = 5;
  using Prepared = Eigen::Matrix3d;

  EssentialProblem(std::span<const PointPair> pairs, std::span<const PointPair> normalised,
                   const Eigen::Matrix3d& first_inverse, const Eigen::Matrix3d& second_inverse)
      : pairs_(pairs),
        normalised_(normalised),
        first_inverse_(first_inverse),
        second_inverse_(second_inverse) {}
  size_t size() const { return pairs_.size(); }
  Candidates Solve(std::span<const uint32_t, kSampleSize> sample) const;
  Prepared Prepare(const Eigen::Matrix3d& e) const {
    return second_inverse_.transpose() * e * first_inverse_;
  }
  double Residual(const Prepared& f, uint32_t i) const { return SampsonSquared(f, pairs_[i]); }
  // Gauss-Newton over rotation and direction, which planar scenes do not upset.
  Eigen::Matrix3d Refine(const Eigen::Matrix3d& e, const MagsacLoss& loss) const;

 private:
  std::span<const PointPair> pairs_, normalised_;
  Eigen::Matrix3d first_inverse_, second_inverse_;
};

}  // namespace pepeseg
