#include "core/edit/move_gaussians.h"

#include <Eigen/QR>
#include <array>
#include <cmath>
#include <numbers>

#include "kernels/gaussian_planes.h"
#include "kernels/math/sh.h"

namespace pepeseg {
namespace {

constexpr int kNumDirections = 32;  // more than the coefficients of a degree, spread evenly

// Returns direction `index` of a spiral from pole to pole.
Eigen::Vector3d Direction(int index) {
  const double z = 1 - (2 * index + 1.0) / kNumDirections;
  const double angle = index * std::numbers::pi * (3 - std::sqrt(5.0));
  const double radius = std::sqrt(1 - z * z);
  return {radius * std::cos(angle), radius * std::sin(angle), z};
}

std::array<double, NumShCoefficients(kMaxShDegree)> BasisAt(const Eigen::Vector3d& direction) {
  std::array<double, NumShCoefficients(kMaxShDegree)> basis{};
  ShBasis<double>({direction.x(), direction.y(), direction.z()}, kMaxShDegree, basis.data());
  return basis;
}

// Returns the matrix that turns the coefficients of a degree: the function that they stand for,
// seen from `direction`, is then the one of before, seen from the direction turned back. It exists,
// as rotations mix the functions of a degree only, and is found from more directions than
// coefficients.
Eigen::MatrixXd TurnOfDegree(const Eigen::Quaterniond& rotation, int degree) {
  const int first = degree * degree, num = 2 * degree + 1;
  Eigen::MatrixXd turned(kNumDirections, num), before(kNumDirections, num);
  for (int i = 0; i < kNumDirections; ++i) {
    const auto here = BasisAt(Direction(i));
    const auto there = BasisAt(rotation.conjugate() * Direction(i));
    for (int k = 0; k < num; ++k) {
      turned(i, k) = here[first + k];
      before(i, k) = there[first + k];
    }
  }
  return turned.colPivHouseholderQr().solve(before);
}

void TurnColors(const Eigen::Quaterniond& rotation, std::span<const int64_t> rows,
                Gaussians& gaussians) {
  for (int degree = 1; degree <= gaussians.sh_degree; ++degree) {
    const Eigen::MatrixXd turn = TurnOfDegree(rotation, degree);
    const int first = degree * degree, num = 2 * degree + 1;
    Eigen::VectorXd coefficients(num);
    for (int channel = 0; channel < 3; ++channel) {
      const auto plane = [&](int k) {
        return gaussians.Plane(kShPlane + 3 * (first + k) + channel);
      };
      for (const int64_t row : rows) {
        for (int k = 0; k < num; ++k) coefficients[k] = plane(k)[row];
        const Eigen::VectorXd turned = turn * coefficients;
        for (int k = 0; k < num; ++k) plane(k)[row] = static_cast<float>(turned[k]);
      }
    }
  }
}

}  // namespace

void MoveGaussians(const Similarity& move, std::span<const int64_t> rows, Gaussians& gaussians) {
  const auto log_scale = static_cast<float>(std::log(move.scale));
  const auto plane = [&](int k) { return gaussians.Plane(k); };
  for (const int64_t row : rows) {
    const Eigen::Vector3d from = MeanOf(gaussians, row) - move.pivot;
    const Eigen::Vector3d mean =
        move.pivot + move.scale * (move.rotation * from) + move.translation;
    Eigen::Quaterniond rotation(plane(kRotationPlane)[row], plane(kRotationPlane + 1)[row],
                                plane(kRotationPlane + 2)[row], plane(kRotationPlane + 3)[row]);
    rotation = move.rotation * rotation;
    const std::array<double, 4> turned = {rotation.w(), rotation.x(), rotation.y(), rotation.z()};
    for (int k = 0; k < 3; ++k) {
      plane(kMeanPlane + k)[row] = static_cast<float>(mean[k]);
      plane(kLogScalePlane + k)[row] += log_scale;
    }
    for (int k = 0; k < 4; ++k) plane(kRotationPlane + k)[row] = static_cast<float>(turned[k]);
  }
  // Without a rotation the coefficients stay as they are, to the last bit.
  if (std::abs(move.rotation.w()) < 1) TurnColors(move.rotation, rows, gaussians);
}

}  // namespace pepeseg
