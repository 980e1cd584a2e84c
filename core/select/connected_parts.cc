#include "core/select/connected_parts.h"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <numeric>

namespace pepeseg {
namespace {

constexpr int kNumNeighbors = 16;  // without the Gaussian itself
constexpr float kReach = 3;        // standard deviations

// Union-find over the selected Gaussians, by their position in `selected`.
class DisjointParts {
 public:
  explicit DisjointParts(size_t count) : next_(count) { std::iota(next_.begin(), next_.end(), 0); }
  // Returns the representative of the part of i. Halves the path on the way.
  int32_t Find(int32_t i) {
    while (next_[i] != i) i = next_[i] = next_[next_[i]];
    return i;
  }
  // Joins the parts of a and b. The smaller position becomes the representative, so that the result
  // does not depend on the order of joins.
  void Join(int32_t a, int32_t b) {
    a = Find(a), b = Find(b);
    if (a < b) next_[b] = a;
    if (b < a) next_[a] = b;
  }

 private:
  std::vector<int32_t> next_;
};

// Returns three consecutive parameters of a Gaussian.
Eigen::Vector3f ThreePlanes(const Gaussians& gaussians, int first, int32_t gaussian) {
  return {gaussians.Plane(first)[gaussian], gaussians.Plane(first + 1)[gaussian],
          gaussians.Plane(first + 2)[gaussian]};
}

// Returns the standard deviation of a Gaussian along a unit vector: sqrt(d^T Sigma d).
float DeviationAlong(const Gaussians& gaussians, int32_t gaussian,
                     const Eigen::Vector3f& direction) {
  const Eigen::Vector3f imaginary = ThreePlanes(gaussians, kRotationPlane + 1, gaussian);
  const Eigen::Quaternionf rotation(gaussians.Plane(kRotationPlane)[gaussian], imaginary.x(),
                                    imaginary.y(), imaginary.z());
  const Eigen::Vector3f scale = ThreePlanes(gaussians, kLogScalePlane, gaussian).array().exp();
  // Sigma = R S S^T R^T, so that sqrt(d^T Sigma d) = |S R^T d|.
  return scale.cwiseProduct(rotation.normalized().conjugate() * direction).norm();
}

// Returns whether two Gaussians touch, see ConnectedParts.
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

std::vector<int32_t> ConnectedParts(const Gaussians& gaussians, std::span<const int32_t> selected) {
  std::vector<int32_t> part(selected.size());
  if (selected.empty()) return part;
  const MeanTree tree(gaussians, selected);
  DisjointParts parts(selected.size());
  for (size_t i = 0; i < selected.size(); ++i) {
    // One more than the neighbours: the Gaussian finds itself.
    for (const int32_t near : tree.Nearest(selected[i], kNumNeighbors + 1)) {
      if (Touch(gaussians, selected[i], selected[near])) parts.Join(static_cast<int32_t>(i), near);
    }
  }
  int32_t num_parts = 0;
  for (size_t i = 0; i < selected.size(); ++i) {
    // The representative is the lowest position of its part, so it has a number before its members
    // ask for it.
    const int32_t lead = parts.Find(static_cast<int32_t>(i));
    part[i] = lead == static_cast<int32_t>(i) ? num_parts++ : part[lead];
  }
  return part;
}

}  // namespace pepeseg
