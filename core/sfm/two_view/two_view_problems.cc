#include "core/sfm/two_view/two_view_problems.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <cmath>
#include <optional>
#include <vector>

namespace pepeseg {
namespace {

using Vector9d = Eigen::Matrix<double, 9, 1>;
using Matrix9d = Eigen::Matrix<double, 9, 9>;

// Returns the matrix whose elements are the eigenvector of the smallest eigenvalue; not finite if
// there is none.
Eigen::Matrix3d SmallestOf(const Matrix9d& lower) {
  const Eigen::SelfAdjointEigenSolver<Matrix9d> solver(lower);
  if (solver.info() != Eigen::Success) return Eigen::Matrix3d::Constant(NAN);
  const Vector9d smallest = solver.eigenvectors().col(0);
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(smallest.data());
}

// Adds weight * row row' to the lower triangle.
void AddRow(const Vector9d& row, double weight, Matrix9d& gram) {
  for (int c = 0; c < 9; ++c) {
    const double factor = weight * row[c];
    for (int r = c; r < 9; ++r) gram(r, c) += factor * row[r];
  }
}

// Returns the squared distance between `to` and the place to which `h` maps `from`.
double TransferSquared(const Eigen::Matrix3d& h, const Eigen::Vector2d& from,
                       const Eigen::Vector2d& to) {
  const double x = from.x(), y = from.y();
  const double inverse = 1 / (h(2, 0) * x + h(2, 1) * y + h(2, 2));
  const double dx = (h(0, 0) * x + h(0, 1) * y + h(0, 2)) * inverse - to.x();
  const double dy = (h(1, 0) * x + h(1, 1) * y + h(1, 2)) * inverse - to.y();
  return dx * dx + dy * dy;
}

template <size_t kSize>
std::array<PointPair, kSize> Picked(std::span<const PointPair> pairs,
                                    std::span<const uint32_t, kSize> sample) {
  std::array<PointPair, kSize> picked;
  for (size_t k = 0; k < kSize; ++k) picked[k] = pairs[sample[k]];
  return picked;
}

}  // namespace

Candidates FundamentalProblem::Solve(std::span<const uint32_t, kSampleSize> sample) const {
  return SolveFundamental(Picked(pairs_, sample));
}

Eigen::Matrix3d FundamentalProblem::Refine(const Eigen::Matrix3d& f, const MagsacLoss& loss) const {
  Matrix9d gram = Matrix9d::Zero();
  for (const PointPair& pair : pairs_) {
    const double weight = loss.Weight(SampsonSquared(f, pair));
    if (weight <= 0) continue;
    const Eigen::Vector3d first = pair.first.homogeneous(), second = pair.second.homogeneous();
    const double slope =
        (f * first).head<2>().squaredNorm() + (f.transpose() * second).head<2>().squaredNorm();
    Vector9d row;
    row << second.x() * first, second.y() * first, first;
    AddRow(row, weight / slope, gram);
  }
  const Eigen::Matrix3d fitted = SmallestOf(gram);
  if (!fitted.allFinite()) return fitted;
  // The nearest matrix of rank 2.
  Eigen::JacobiSVD<Eigen::Matrix3d> svd(fitted, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Vector3d values(svd.singularValues()[0], svd.singularValues()[1], 0);
  return (svd.matrixU() * values.asDiagonal() * svd.matrixV().transpose()).normalized();
}

Candidates HomographyProblem::Solve(std::span<const uint32_t, kSampleSize> sample) const {
  return SolveHomography(Picked(pairs_, sample));
}

HomographyProblem::Prepared HomographyProblem::Prepare(const Eigen::Matrix3d& h) const {
  return {h, h.inverse()};
}

double HomographyProblem::Residual(const Prepared& h, uint32_t i) const {
  const PointPair& pair = pairs_[i];
  return (TransferSquared(h.forward, pair.first, pair.second) +
          TransferSquared(h.backward, pair.second, pair.first)) /
         4;
}

Eigen::Matrix3d HomographyProblem::Refine(const Eigen::Matrix3d& h, const MagsacLoss& loss) const {
  const Prepared prepared = Prepare(h);
  Matrix9d gram = Matrix9d::Zero();
  for (uint32_t i = 0; i < size(); ++i) {
    const double weight = loss.Weight(Residual(prepared, i));
    if (weight <= 0) continue;
    const Eigen::Vector3d first = pairs_[i].first.homogeneous(), zero = Eigen::Vector3d::Zero();
    const double depth = h.row(2).dot(first);
    Vector9d row;
    row << first, zero, -pairs_[i].second.x() * first;
    AddRow(row, weight / (depth * depth), gram);
    row << zero, first, -pairs_[i].second.y() * first;
    AddRow(row, weight / (depth * depth), gram);
  }
  return SmallestOf(gram);
}

Candidates EssentialProblem::Solve(std::span<const uint32_t, kSampleSize> sample) const {
  return SolveEssential(Picked(normalised_, sample));
}

Eigen::Matrix3d EssentialProblem::Refine(const Eigen::Matrix3d& e, const MagsacLoss& loss) const {
  const Prepared f = Prepare(e);
  std::vector<PointPair> inliers;
  std::vector<double> weights;
  for (uint32_t i = 0; i < size(); ++i) {
    const double weight = loss.Weight(Residual(f, i));
    if (weight <= 0) continue;
    inliers.push_back(normalised_[i]);
    weights.push_back(weight);
  }
  const std::optional<CheiralPose> pose = DecomposeEssential(e, inliers);
  if (!pose) return Eigen::Matrix3d::Constant(NAN);
  return EssentialMatrix(RefineRelativePose(pose->pose, inliers, weights, 3));
}

}  // namespace pepeseg
