#include "core/sfm/two_view/minimal_solvers.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <numbers>
#include <utility>

namespace pepeseg {
namespace {

// A pivot below this share of the largest one counts as zero.
constexpr double kTinyPivot = 1e-9;

// Computes a basis of the null space of a matrix of full rank by elimination with complete
// pivoting. Returns false if the rank is lower.
template <int kRows, int kCols>
bool NullSpace(Eigen::Matrix<double, kRows, kCols> a,
               std::array<Eigen::Matrix<double, kCols, 1>, kCols - kRows>& basis) {
  std::array<int, kCols> order;
  for (int c = 0; c < kCols; ++c) order[c] = c;
  double largest = 0;
  for (int step = 0; step < kRows; ++step) {
    int row, col;
    const double pivot =
        a.template bottomRightCorner(kRows - step, kCols - step).cwiseAbs().maxCoeff(&row, &col);
    largest = std::max(largest, pivot);
    if (!(pivot > kTinyPivot * largest)) return false;
    a.row(step).swap(a.row(step + row));
    a.col(step).swap(a.col(step + col));
    std::swap(order[step], order[step + col]);
    a.row(step) /= a(step, step);
    for (int r = 0; r < kRows; ++r) {
      if (r != step) a.row(r) -= a(r, step) * a.row(step);
    }
  }
  for (int free = 0; free < kCols - kRows; ++free) {
    basis[free].setZero();
    for (int r = 0; r < kRows; ++r) basis[free][order[r]] = -a(r, kRows + free);
    basis[free][order[kRows + free]] = 1;
    basis[free].normalize();
  }
  return true;
}

using Vector9d = Eigen::Matrix<double, 9, 1>;

Eigen::Matrix3d ToMatrix(const Vector9d& v) {
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(v.data());
}

// Sets a row to the coefficients of second' F first in the elements of F.
template <typename Row>
void SetEpipolarRow(const PointPair& pair, Row row) {
  const Eigen::Vector3d first = pair.first.homogeneous();
  row << pair.second.x() * first.transpose(), pair.second.y() * first.transpose(),
      first.transpose();
}

// Solves a x^3 + b x^2 + c x + d = 0 for its real roots. Returns their number.
int SolveCubic(double a, double b, double c, double d, std::array<double, 3>& roots) {
  const double scale = std::max({std::abs(b), std::abs(c), std::abs(d)});
  if (!(std::abs(a) > 1e-12 * scale)) return 0;
  b /= a, c /= a, d /= a;
  const double q = (b * b - 3 * c) / 9, r = (2 * b * b * b - 9 * b * c + 27 * d) / 54;
  int count = 1;
  if (r * r < q * q * q) {
    const double angle = std::acos(r / std::sqrt(q * q * q));
    for (int k = 0; k < 3; ++k) {
      roots[k] = -2 * std::sqrt(q) * std::cos((angle + 2 * std::numbers::pi * (k - 1)) / 3) - b / 3;
    }
    count = 3;
  } else {
    const double s = -std::copysign(std::cbrt(std::abs(r) + std::sqrt(r * r - q * q * q)), r);
    roots[0] = s + (s == 0 ? 0 : q / s) - b / 3;
  }
  for (int k = 0; k < count; ++k) {
    // One step of Newton takes back what the closed form loses to cancellation.
    const double x = roots[k], slope = (3 * x + 2 * b) * x + c;
    if (slope != 0) roots[k] -= (((x + b) * x + c) * x + d) / slope;
  }
  return count;
}

Eigen::Matrix3d Adjugate(const Eigen::Matrix3d& m) {
  Eigen::Matrix3d adjugate;
  adjugate.row(0) = m.col(1).cross(m.col(2));
  adjugate.row(1) = m.col(2).cross(m.col(0));
  adjugate.row(2) = m.col(0).cross(m.col(1));
  return adjugate;
}

// Returns whether all pairs see the epipole on the same side: the sign of (e' x second) . (F first)
// is the same for all, with e' the left null vector of F.
bool IsOriented(const Eigen::Matrix3d& f, std::span<const PointPair> pairs) {
  // Each row of the adjugate of a matrix of rank 2 is a multiple of its left null vector.
  const Eigen::Matrix3d adjugate = Adjugate(f);
  int row;
  adjugate.rowwise().squaredNorm().maxCoeff(&row);
  const Eigen::Vector3d epipole = adjugate.row(row);
  int num_positive = 0;
  for (const PointPair& pair : pairs) {
    const Eigen::Vector3d line = f * pair.first.homogeneous();
    if (epipole.cross(pair.second.homogeneous()).dot(line) > 0) ++num_positive;
  }
  return num_positive == 0 || num_positive == static_cast<int>(pairs.size());
}

// Returns twice the signed area of a triangle.
double Area(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c) {
  return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
}

// Polynomials in x, y, z: coefficients of the monomials of degree 3, 2, 1 and 0 in this order, so
// that the last 10 are a quadratic polynomial and the last 4 a linear one.
constexpr int kMonomials[20][3] = {{3, 0, 0}, {2, 1, 0}, {1, 2, 0}, {0, 3, 0}, {2, 0, 1},
                                   {1, 1, 1}, {0, 2, 1}, {1, 0, 2}, {0, 1, 2}, {0, 0, 3},
                                   {2, 0, 0}, {1, 1, 0}, {0, 2, 0}, {1, 0, 1}, {0, 1, 1},
                                   {0, 0, 2}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 0}};
using Linear = Eigen::Matrix<double, 1, 4>;
using Quadratic = Eigen::Matrix<double, 1, 10>;
using Cubic = Eigen::Matrix<double, 1, 20>;

// Index of the product of two monomials among the 20.
constexpr auto kProducts = [] {
  std::array<std::array<int, 20>, 20> products{};
  for (int i = 0; i < 20; ++i) {
    for (int j = 0; j < 20; ++j) {
      for (int k = 0; k < 20; ++k) {
        bool equal = true;
        for (int axis = 0; axis < 3; ++axis) {
          equal = equal && kMonomials[i][axis] + kMonomials[j][axis] == kMonomials[k][axis];
        }
        if (equal) products[i][j] = k;
      }
    }
  }
  return products;
}();

Quadratic Times(const Linear& a, const Linear& b) {
  Quadratic product = Quadratic::Zero();
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < 4; ++j) product[kProducts[16 + i][16 + j] - 10] += a[i] * b[j];
  }
  return product;
}

Cubic Times(const Quadratic& a, const Linear& b) {
  Cubic product = Cubic::Zero();
  for (int i = 0; i < 10; ++i) {
    for (int j = 0; j < 4; ++j) product[kProducts[10 + i][16 + j]] += a[i] * b[j];
  }
  return product;
}

// Computes the ten cubic constraints on E = x E0 + y E1 + z E2 + E3: 2 E E' E - tr(E E') E = 0 and
// det E = 0.
Eigen::Matrix<double, 10, 20> EssentialConstraints(const std::array<Vector9d, 4>& basis) {
  Linear e[3][3];
  for (int i = 0; i < 9; ++i) {
    e[i / 3][i % 3] << basis[0][i], basis[1][i], basis[2][i], basis[3][i];
  }
  Quadratic gram[3][3], trace = Quadratic::Zero();
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      gram[i][j] = Times(e[i][0], e[j][0]) + Times(e[i][1], e[j][1]) + Times(e[i][2], e[j][2]);
    }
    trace += gram[i][i];
  }
  Eigen::Matrix<double, 10, 20> constraints;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      Cubic sum = -Times(trace, e[i][j]);
      for (int k = 0; k < 3; ++k) sum += 2 * Times(gram[i][k], e[k][j]);
      constraints.row(3 * i + j) = sum;
    }
  }
  const auto minor = [&](int a, int b) {
    return Quadratic(Times(e[1][a], e[2][b]) - Times(e[1][b], e[2][a]));
  };
  constraints.row(9) =
      Times(minor(1, 2), e[0][0]) - Times(minor(0, 2), e[0][1]) + Times(minor(0, 1), e[0][2]);
  return constraints;
}

}  // namespace

Candidates SolveFundamental(std::span<const PointPair, 7> pairs) {
  Candidates candidates;
  Eigen::Matrix<double, 7, 9> rows;
  for (int i = 0; i < 7; ++i) SetEpipolarRow(pairs[i], rows.row(i));
  std::array<Vector9d, 2> basis;
  if (!NullSpace<7, 9>(rows, basis)) return candidates;
  const Eigen::Matrix3d a = ToMatrix(basis[0]), b = ToMatrix(basis[1]);
  const Eigen::Matrix3d adjugate_a = Adjugate(a), adjugate_b = Adjugate(b);
  std::array<double, 3> roots{};
  const int count = SolveCubic(a.determinant(), (adjugate_a * b).trace(), (adjugate_b * a).trace(),
                               b.determinant(), roots);
  for (int i = 0; i < count; ++i) {
    const Eigen::Matrix3d f = (roots[i] * a + b).normalized();
    if (IsOriented(f, pairs)) candidates.Add(f);
  }
  return candidates;
}

Candidates SolveHomography(std::span<const PointPair, 4> pairs) {
  Candidates candidates;
  // Each triangle keeps its orientation, else the plane is seen from behind.
  for (int skipped = 0; skipped < 4; ++skipped) {
    const int a = skipped == 0, b = 1 + (skipped <= 1), c = 2 + (skipped <= 2);
    const double first = Area(pairs[a].first, pairs[b].first, pairs[c].first);
    const double second = Area(pairs[a].second, pairs[b].second, pairs[c].second);
    if (!(first * second > 0)) return candidates;
  }
  Eigen::Matrix<double, 8, 9> rows;
  for (int i = 0; i < 4; ++i) {
    const Eigen::RowVector3d first = pairs[i].first.homogeneous().transpose();
    const Eigen::RowVector3d zero = Eigen::RowVector3d::Zero();
    rows.row(2 * i) << first, zero, -pairs[i].second.x() * first;
    rows.row(2 * i + 1) << zero, first, -pairs[i].second.y() * first;
  }
  std::array<Vector9d, 1> basis;
  if (NullSpace<8, 9>(rows, basis)) candidates.Add(ToMatrix(basis[0]));
  return candidates;
}

Candidates SolveEssential(std::span<const PointPair, 5> pairs) {
  Candidates candidates;
  Eigen::Matrix<double, 5, 9> rows;
  for (int i = 0; i < 5; ++i) SetEpipolarRow(pairs[i], rows.row(i));
  std::array<Vector9d, 4> basis;
  if (!NullSpace<5, 9>(rows, basis)) return candidates;
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < i; ++j) basis[i] -= basis[j].dot(basis[i]) * basis[j];
    basis[i].normalize();
  }
  const Eigen::Matrix<double, 10, 20> constraints = EssentialConstraints(basis);
  const Eigen::PartialPivLU<Eigen::Matrix<double, 10, 10>> lu(constraints.leftCols<10>());
  const Eigen::Matrix<double, 10, 10> reduced = lu.solve(constraints.rightCols<10>());
  if (!reduced.allFinite()) return candidates;
  // Multiplication by x maps x^2, xy, y^2, xz, yz, z^2 to monomials of degree 3, which the
  // constraints express in the lower ones, and x, y, z, 1 to x^2, xy, xz, x.
  Eigen::Matrix<double, 10, 10> action = Eigen::Matrix<double, 10, 10>::Zero();
  constexpr int kCubicRows[6] = {0, 1, 2, 4, 5, 7};
  for (int i = 0; i < 6; ++i) action.row(i) = -reduced.row(kCubicRows[i]);
  action(6, 0) = action(7, 1) = action(8, 3) = action(9, 6) = 1;
  const Eigen::EigenSolver<Eigen::Matrix<double, 10, 10>> solver(action);
  if (solver.info() != Eigen::Success) return candidates;
  for (int i = 0; i < 10; ++i) {
    if (solver.eigenvalues()[i].imag() != 0) continue;
    const Eigen::Matrix<double, 10, 1> v = solver.eigenvectors().col(i).real();
    const Vector9d e =
        v[6] / v[9] * basis[0] + v[7] / v[9] * basis[1] + v[8] / v[9] * basis[2] + basis[3];
    candidates.Add(ToMatrix(e) * (std::numbers::sqrt2 / e.norm()));
  }
  return candidates;
}

}  // namespace pepeseg
