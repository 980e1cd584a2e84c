#pragma once

#include <Eigen/Core>
#include <array>
#include <span>

#include "core/sfm/two_view/point_pair.h"

namespace pepeseg {

// Up to ten matrices that fit a minimal sample.
struct Candidates {
  std::array<Eigen::Matrix3d, 10> matrices;
  int count = 0;

  void Add(const Eigen::Matrix3d& matrix) {
    if (count < 10 && matrix.allFinite()) matrices[count++] = matrix;
  }
};

// Fundamental matrices F with second' F first = 0 for seven pairs, of norm 1 (Hartley and Zisserman
// 2003, 11.1.2): up to three, none for a degenerate sample. Those whose epipolar lines are oriented
// differently for two of the pairs are left out: a point would be behind a camera (Chum, Werner and
// Matas 2004).
Candidates SolveFundamental(std::span<const PointPair, 7> pairs);

// The homography H with second ~ H first for four pairs, of norm 1; none if three points are
// collinear, or if H turns the plane over (Hartley and Zisserman 2003, 4.1).
Candidates SolveHomography(std::span<const PointPair, 4> pairs);

// Essential matrices E with second' E first = 0 for five pairs in normalised coordinates, of norm
// sqrt(2): up to ten (Nister 2004; solved by an action matrix as Stewenius, Engels and Nister
// 2006).
Candidates SolveEssential(std::span<const PointPair, 5> pairs);

}  // namespace pepeseg
