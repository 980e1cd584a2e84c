#include "core/select/connected_parts.h"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <numeric>

#include "core/select/mean_tree.h"

namespace pepeseg {
namespace {

constexpr int kNumNeighbors = 16;  // and itself
constexpr float kReach = 3;        // standard deviations

// Of each part, a row in it that all of its rows lead to.
class DisjointParts {
 public:
  explicit DisjointParts(size_t count) : next_(count) { std::iota(next_.begin(), next_.end(), 0); }
  int32_t Find(int32_t i) {
    while (next_[i] != i) i = next_[i] = next_[next_[i]];
    return i;
  }
  // The smaller one leads, so that the result does not depend on the order of joins.
  void Join(int32_t a, int32_t b) {
    a = Find(a), b = Find(b);
    if (a < b) next_[b] = a;
    if (b < a) next_[a] = b;
  }

 private:
  std::vector<int32_t> next_;
};

Eigen::Vector3f ThreePlanes(const Gaussians& gaussians, int first, int32_t row) {
  return {gaussians.Plane(first)[row], gaussians.Plane(first + 1)[row],
          gaussians.Plane(first + 2)[row]};
}

// How far a Gaussian reaches along a direction of length 1, in standard deviations of 1.
float DeviationAlong(const Gaussians& gaussians, int32_t row, const Eigen::Vector3f& direction) {
  const Eigen::Vector3f imaginary = ThreePlanes(gaussians, kRotationPlane + 1, row);
  const Eigen::Quaternionf rotation(gaussians.Plane(kRotationPlane)[row], imaginary.x(),
                                    imaginary.y(), imaginary.z());
  const Eigen::Vector3f scale = ThreePlanes(gaussians, kLogScalePlane, row).array().exp();
  return scale.cwiseProduct(rotation.normalized().conjugate() * direction).norm();
}

bool Touch(const Gaussians& gaussians, int32_t a, int32_t b) {
  const Eigen::Vector3f between =
      ThreePlanes(gaussians, kMeanPlane, b) - ThreePlanes(gaussians, kMeanPlane, a);
  const float distance = between.norm();
  if (distance == 0) return true;
  const Eigen::Vector3f direction = between / distance;
  return distance <= kReach * (DeviationAlong(gaussians, a, direction) +
                               DeviationAlong(gaussians, b, direction));
}

}  // namespace

std::vector<int32_t> ConnectedParts(const Gaussians& gaussians, std::span<const int32_t> rows) {
  std::vector<int32_t> part(rows.size());
  if (rows.empty()) return part;
  const MeanTree tree(gaussians, rows);
  DisjointParts parts(rows.size());
  for (size_t i = 0; i < rows.size(); ++i) {
    for (const int32_t near : tree.Nearest(rows[i], kNumNeighbors + 1)) {
      if (Touch(gaussians, rows[i], rows[near])) parts.Join(static_cast<int32_t>(i), near);
    }
  }
  int32_t num_parts = 0;
  for (size_t i = 0; i < rows.size(); ++i) {
    const int32_t lead = parts.Find(static_cast<int32_t>(i));
    part[i] = lead == static_cast<int32_t>(i) ? num_parts++ : part[lead];
  }
  return part;
}

}  // namespace pepeseg
