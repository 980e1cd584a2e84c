#include "core/sfm/mapper/rotation_averaging.h"

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>
#include <utility>

namespace pepeseg {
namespace {

constexpr double kMaxError = 5 * std::numbers::pi / 180;  // radians, of triangles and edges
constexpr int kL1Steps = 5, kRobustSteps = 20;
constexpr double kSmallest = 0.1 * std::numbers::pi / 180;  // residuals below it count alike
constexpr double kScale = 1 * std::numbers::pi / 180;       // of the robust weights

// Drops edges that are in triangles, none of which closes.
std::vector<ViewEdge> DropOpenTriangles(size_t num_photographs, std::vector<ViewEdge> edges) {
  // Neighbours by number, with the rotation from the photograph to the neighbour.
  std::vector<std::map<uint32_t, Eigen::Matrix3d>> turn_to(num_photographs);
  for (const ViewEdge& edge : edges) {
    turn_to[edge.first][edge.second] = edge.pose.rotation;
    turn_to[edge.second][edge.first] = edge.pose.rotation.transpose();
  }
  std::erase_if(edges, [&](const ViewEdge& edge) {
    int num_triangles = 0;
    for (const auto& [third, turn] : turn_to[edge.first]) {
      const auto back = turn_to[third].find(edge.second);
      if (back == turn_to[third].end()) continue;
      ++num_triangles;
      const Eigen::Matrix3d way = back->second * turn;
      if (RotationAngle(edge.pose.rotation.transpose() * way) < kMaxError) return false;
    }
    return num_triangles > 0;
  });
  return edges;
}

// The rotations of one connected component.
class Averaging {
 public:
  Averaging(size_t num_photographs, std::span<const ViewEdge> edges)
      : edges_(edges),
        rotations_(num_photographs, Eigen::Matrix3d::Identity()),
        unknown_(num_photographs, -1) {}

  std::vector<Eigen::Matrix3d> Run(const std::vector<bool>& is_known) {
    SpanTree(is_known);
    for (int step = 0; step < kL1Steps + kRobustSteps; ++step) {
      if (Step(step < kL1Steps) < 1e-9) break;
    }
    return rotations_;
  }

 private:
  // Chains rotations along the maximum spanning tree and numbers the unknowns; the first known
  // photograph stays fixed.
  void SpanTree(const std::vector<bool>& is_known);
  // Solves for one update of all rotations. Returns its largest angle.
  double Step(bool l1);

  std::span<const ViewEdge> edges_;
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
      if (!best || edge.inliers.size() > best->inliers.size()) best = &edge;
    }
    if (!best) break;
    const bool forward = reached[best->first];
    const uint32_t added = forward ? best->second : best->first;
    if (forward) {
      rotations_[added] = best->pose.rotation * rotations_[best->first];
    } else {
      rotations_[added] = best->pose.rotation.transpose() * rotations_[best->second];
    }
    reached[added] = true;
    unknown_[added] = num_unknown_++;
  }
}

double Averaging::Step(bool l1) {
  if (num_unknown_ == 0) return 0;
  std::vector<Eigen::Triplet<double>> triplets;
  Eigen::MatrixXd right = Eigen::MatrixXd::Zero(num_unknown_, 3);
  for (const ViewEdge& edge : edges_) {
    // With R <- R exp(w), exp(-w2) R2' R12 R1 exp(w1) is the identity if w2 - w1 is the residual.
    const Eigen::Vector3d residual = VectorFromRotation(
        rotations_[edge.second].transpose() * edge.pose.rotation * rotations_[edge.first]);
    const double size = residual.norm();
    double weight = std::sqrt(static_cast<double>(edge.inliers.size()));
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

void KeepKnown(const std::vector<bool>& is_known, std::vector<ViewEdge>& edges) {
  std::erase_if(edges, [&](const ViewEdge& edge) { return !is_known[edge.first]; });
}

}  // namespace

AveragedRotations AverageRotations(size_t num_photographs, std::vector<ViewEdge> edges) {
  AveragedRotations result;
  result.edges = DropOpenTriangles(num_photographs, std::move(edges));
  for (int round = 0; round < 2; ++round) {
    result.is_known = LargestComponent(num_photographs, result.edges);
    KeepKnown(result.is_known, result.edges);
    result.rotations = Averaging(num_photographs, result.edges).Run(result.is_known);
    std::erase_if(result.edges, [&](const ViewEdge& edge) {
      return RotationAngle(result.rotations[edge.second].transpose() * edge.pose.rotation *
                           result.rotations[edge.first]) > kMaxError;
    });
  }
  result.is_known = LargestComponent(num_photographs, result.edges);
  KeepKnown(result.is_known, result.edges);
  return result;
}

}  // namespace pepeseg
