#pragma once

#include <Eigen/Core>

#include "absl/status/statusor.h"
#include "core/scene/gaussians.h"

namespace pepeseg {

// INVALID_ARGUMENT: the sets are of models of different size.
absl::StatusOr<GaussianSet> Union(const GaussianSet& a, const GaussianSet& b);
// `a` without `b`.
absl::StatusOr<GaussianSet> Subtract(const GaussianSet& a, const GaussianSet& b);
absl::StatusOr<GaussianSet> Intersect(const GaussianSet& a, const GaussianSet& b);

// The axis-aligned box around the means of the members, scene units; empty() when there are none.
struct SetBounds {
  Eigen::Vector3d min = Eigen::Vector3d::Constant(1);
  Eigen::Vector3d max = Eigen::Vector3d::Constant(-1);

  bool empty() const { return (min.array() > max.array()).any(); }
};
// The set is of these Gaussians.
SetBounds BoundsOf(const Gaussians& gaussians, const GaussianSet& set);

}  // namespace pepeseg
