#pragma once

#include <Eigen/Core>

#include "absl/status/statusor.h"
#include "core/scene/gaussians.h"

namespace pepeseg {

// Return the Gaussians in a or b, in a but not in b, and in both. INVALID_ARGUMENT: the sets are of
// models of different size.
absl::StatusOr<GaussianSet> Union(const GaussianSet& a, const GaussianSet& b);
absl::StatusOr<GaussianSet> Subtract(const GaussianSet& a, const GaussianSet& b);
absl::StatusOr<GaussianSet> Intersect(const GaussianSet& a, const GaussianSet& b);

// Axis-aligned bounding box of the means of a set, scene units. empty() if the set has no member.
struct SetBounds {
  Eigen::Vector3d min = Eigen::Vector3d::Constant(1);
  Eigen::Vector3d max = Eigen::Vector3d::Constant(-1);

  bool empty() const { return (min.array() > max.array()).any(); }
};
// Returns the bounds of a set of these Gaussians.
SetBounds BoundsOf(const Gaussians& gaussians, const GaussianSet& set);

}  // namespace pepeseg
