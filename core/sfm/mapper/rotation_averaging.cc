#include "core/sfm/mapper/rotation_averaging.h"

#include <Eigen/Geometry>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "core/sfm/mapper/pose_choice.h"

namespace pepeseg {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kMaxTriangleError = 5 * kDegree, kMaxError = 5 * kDegree;
constexpr int kL1Steps = 10, kRobustSteps = 20, kAverages = 3;
constexpr double kSmallest = 0.1 * kDegree;  // residuals below it count alike
constexpr double kScale = 1 * kDegree;       // of the robust weights

// The rotations of one connected component.
class Averaging {
 public:
  // Chooses the poses of ambiguous edges as well, see ChooseClosest.
  Averaging(size_t num_photographs, std::span<ViewEdge> edges)
      : edges_(edges),
        rotations_(num_photographs, Eigen::Matrix3d::Identity()),
        unknown_(num_photographs, -1) {}

  std::vector<Eigen::Matrix3d> Run(const std::vector<bool>& is_known) {
    SpanTree(is_known);
    for (int step = 0; step < kL1Steps + kRobustSteps; ++step) {
      if (Step(step < kL1Steps) < 1e-9 && step >= kL1Steps) break;
    }
    return rotations_;
  }

 private:
  // Chains rotations along the maximum spanning tree and numbers the unknowns; the first known
  // photograph stays fixed.
  void SpanTree(const std::vector<bool>& is_known);
  // Solves for one update of all rotations. Returns its largest angle.
  double Step(bool l1);

  std::span<ViewEdge> edges_;
  std::vector<Eigen::Matrix3d> rotations_;
  std::vector<int> unknown_;  // column of each photograph, or -1
  int num_unknown_ = 0;
};

void Averaging::SpanTree(const std::vector<bool>& is_known) {
  const auto first =
      static_cast<uint32_t>(std::find(is_known.begin(), is_known.end(), true) - is_known.begin());
  std::vector<bool> reached(is_known.size(), false);
  reached[first] = true;
  // Prim's algorithm: the edge with the most inliers from the tree outwards.
  for (;;) {
    const ViewEdge* best = nullptr;
    for (const ViewEdge& edge : edges_) {
      if (reached[edge.first] == reached[edge.second]) continue;
      if (!best || edge.view.inliers.size() > best->view.inliers.size()) best = &edge;
    }
    if (!best) break;
    const bool forward = reached[best->first];
    const uint32_t added = forward ? best->second : best->first;
    const Eigen::Matrix3d& turn = best->view.pose.rotation;
    rotations_[added] = forward ? Eigen::Matrix3d(turn * rotations_[best->first])
                                : Eigen::Matrix3d(turn.transpose() * rotations_[best->second]);
    reached[added] = true;
    unknown_[added] = num_unknown_++;
  }
}

double Averaging::Step(bool l1) {
  if (num_unknown_ == 0) return 0;
  std::vector<Eigen::Triplet<double>> triplets;
  Eigen::MatrixXd right = Eigen::MatrixXd::Zero(num_unknown_, 3);
  for (ViewEdge& edge : edges_) {
    ChooseClosest(rotations_[edge.second] * rotations_[edge.first].transpose(), edge);
    // With R <- R exp(w), exp(-w2) R2' R12 R1 exp(w1) is the identity if w2 - w1 is the residual.
    const Eigen::Vector3d residual = VectorFromRotation(
        rotations_[edge.second].transpose() * edge.view.pose.rotation * rotations_[edge.first]);
    const double size = residual.norm();
    auto weight = static_cast<double>(edge.view.inliers.size());
    if (l1) {
      weight /= std::max(size, kSmallest);
    } else {
      // Geman and McClure's weight.
      const double ratio = size * size / (kScale * kScale);
      weight /= (1 + ratio) * (1 + ratio);
    }
    const int a = unknown_[edge.first], b = unknown_[edge.second];
    if (a >= 0) {
      triplets.emplace_back(a, a, weight);
      right.row(a) -= weight * residual.transpose();
    }
    if (b >= 0) {
      triplets.emplace_back(b, b, weight);
      right.row(b) += weight * residual.transpose();
    }
    if (a >= 0 && b >= 0) triplets.emplace_back(std::max(a, b), std::min(a, b), -weight);
  }
  Eigen::SparseMatrix<double> matrix(num_unknown_, num_unknown_);
  matrix.setFromTriplets(triplets.begin(), triplets.end());
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(matrix);
  if (solver.info() != Eigen::Success) return 0;
  const Eigen::MatrixXd update = solver.solve(right);
  if (!update.allFinite()) return 0;
  for (size_t i = 0; i < rotations_.size(); ++i) {
    if (unknown_[i] < 0) continue;
    rotations_[i] *= RotationFromVector(update.row(unknown_[i]).transpose());
  }
  return update.rowwise().norm().maxCoeff();
}

}  // namespace

AveragedRotations AverageRotations(size_t num_photographs, std::vector<ViewEdge> edges,
                                   ThreadPool& pool) {
  AveragedRotations result;
  result.edges = std::move(edges);
  for (int round = 0; round < kAverages; ++round) {
    const std::vector<TriangleSupport> found =
        ChoosePoses(num_photographs, kMaxTriangleError, result.edges, pool);
    std::vector<ViewEdge> kept;
    for (size_t i = 0; i < found.size(); ++i) {
      if (found[i].support == 0 && found[i].num_triangles > 0) continue;
      kept.push_back(std::move(result.edges[i]));
    }
    result.edges = std::move(kept);
    result.is_known = LargestComponent(num_photographs, result.edges);
    result.rotations = Averaging(num_photographs, result.edges).Run(result.is_known);
    std::erase_if(result.edges, [&](ViewEdge& edge) {
      return !result.is_known[edge.first] ||
             ChooseClosest(result.rotations[edge.second] * result.rotations[edge.first].transpose(),
                           edge) > kMaxError;
    });
  }
  result.is_known = LargestComponent(num_photographs, result.edges);
  std::erase_if(result.edges, [&](const ViewEdge& edge) { return !result.is_known[edge.first]; });
  return result;
}

}  // namespace pepeseg
