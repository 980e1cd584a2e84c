#pragma once

#include "kernels/math/hd.h"

// Distances of HDBSCAN (Campello, Moulavi and Sander 2013; kernels/ops/cluster.h), squared. All
// backends add the channels one by one in their order, so that those with a fused multiply-add find
// the same bits, and the same tree.

namespace pepeseg {

// Returns sum + (a - b)^2, one channel of a squared distance. Bitwise symmetric in a and b.
template <class T>
PEPESEG_HD T AddSquare(T a, T b, T sum) {
  const T difference = a - b;
  return MulAdd(difference, difference, sum);
}

// Squared mutual reachability: the largest of the squared distance and both squared core distances.
// A squared distance that is NaN counts as infinite. Core distances must not be NaN.
template <class T>
PEPESEG_HD T MutualReach(T squared, T core_a, T core_b) {
  const T infinity(INFINITY);
  return Max(Max(core_a, core_b), Select(squared < infinity, squared, infinity));
}

}  // namespace pepeseg
