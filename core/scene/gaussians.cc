#include "core/scene/gaussians.h"

#include <algorithm>
#include <cassert>
#include <limits>

#include "absl/strings/str_cat.h"

namespace pepeseg {
namespace {

// Returns the set of the Gaussians for which operation(is in a, is in b).
template <class Operation>
absl::StatusOr<GaussianSet> Combine(const GaussianSet& a, const GaussianSet& b,
                                    Operation operation) {
  if (a.member.size() != b.member.size()) {
    return absl::InvalidArgumentError(absl::StrCat("sets of ", a.member.size(), " and of ",
                                                   b.member.size(),
                                                   " Gaussians do not belong to the same model"));
  }
  GaussianSet result;
  result.member.resize(a.member.size());
  std::transform(a.member.begin(), a.member.end(), b.member.begin(), result.member.begin(),
                 [&](uint8_t x, uint8_t y) { return operation(x != 0, y != 0) ? 1 : 0; });
  return result;
}

}  // namespace

Gaussians Gaussians::Zero(int64_t count, int sh_degree) {
  assert(count >= 0 && sh_degree >= 0 && sh_degree <= kMaxShDegree);
  Gaussians result{.count = count, .sh_degree = sh_degree, .planes = {}};
  result.planes.assign(static_cast<size_t>(count) * NumPlanes(sh_degree), 0.0f);
  return result;
}

Gaussians Gaussians::Select(std::span<const int64_t> rows) const {
  // Plane by plane, so that writes are sequential.
  Gaussians result = Zero(static_cast<int64_t>(rows.size()), sh_degree);
  for (int k = 0; k < NumPlanes(sh_degree); ++k) {
    const std::span<const float> from = Plane(k);
    const std::span<float> to = result.Plane(k);
    for (size_t i = 0; i < rows.size(); ++i) {
      assert(rows[i] >= 0 && rows[i] < count);
      to[i] = from[rows[i]];
    }
  }
  return result;
}

Eigen::Vector3d MeanOf(const Gaussians& gaussians, int64_t row) {
  const auto at = [&](int axis) { return double{gaussians.Plane(kMeanPlane + axis)[row]}; };
  return {at(0), at(1), at(2)};
}

absl::StatusOr<GaussianSet> Union(const GaussianSet& a, const GaussianSet& b) {
  return Combine(a, b, [](bool x, bool y) { return x || y; });
}

absl::StatusOr<GaussianSet> Subtract(const GaussianSet& a, const GaussianSet& b) {
  return Combine(a, b, [](bool x, bool y) { return x && !y; });
}

absl::StatusOr<GaussianSet> Intersect(const GaussianSet& a, const GaussianSet& b) {
  return Combine(a, b, [](bool x, bool y) { return x && y; });
}

SetBounds BoundsOf(const Gaussians& gaussians, const GaussianSet& set) {
  assert(static_cast<int64_t>(set.member.size()) == gaussians.count);
  SetBounds bounds;
  // Bounds are of the means alone, in scene units, without the extent of the Gaussians.
  if (set.count() == 0) return bounds;
  bounds.min.setConstant(std::numeric_limits<double>::infinity());
  bounds.max = -bounds.min;
  for (int axis = 0; axis < 3; ++axis) {
    const auto means = gaussians.Plane(kMeanPlane + axis);
    for (size_t i = 0; i < means.size(); ++i) {
      if (set.member[i] == 0) continue;
      bounds.min[axis] = std::min(bounds.min[axis], double{means[i]});
      bounds.max[axis] = std::max(bounds.max[axis], double{means[i]});
    }
  }
  return bounds;
}

}  // namespace pepeseg
