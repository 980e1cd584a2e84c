#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "kernels/gaussian_planes.h"

namespace pepeseg {

// Gaussians in host memory, stored as the planes of kernels/gaussian_planes.h with
// stride == count.
struct Gaussians {
  int64_t count = 0;
  int sh_degree = 0;          // [0, kMaxShDegree]
  std::vector<float> planes;  // [NumPlanes(sh_degree), count]

  // Returns `count` Gaussians whose parameters are all 0.
  static Gaussians Zero(int64_t count, int sh_degree);
  // Returns plane `k`, 0 <= k < NumPlanes(sh_degree): one parameter of all Gaussians.
  std::span<float> Plane(int k) { return {planes.data() + k * count, static_cast<size_t>(count)}; }
  std::span<const float> Plane(int k) const {
    return {planes.data() + k * count, static_cast<size_t>(count)};
  }
  // Returns copies of the Gaussians with the indices `rows`, in that order. An index may repeat.
  Gaussians Select(std::span<const int64_t> rows) const;
};

// Returns the mean of a Gaussian.
Eigen::Vector3d MeanOf(const Gaussians& gaussians, int64_t row);

// A subset of a model's Gaussians.
struct GaussianSet {
  std::vector<uint8_t> member;  // [num_gaussians], 0 or 1

  // Returns the number of members.
  int64_t count() const { return std::count(member.begin(), member.end(), uint8_t{1}); }
};

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
