#pragma once

#include "kernels/math/hd.h"

// Distances of clustering (kernels/ops/cluster.h). All backends add the channels one by one in
// their order, so that where they have a fused multiply-add they find the same bits.

namespace pepeseg {

// `sum` and one channel's share of a squared distance: the same for (a, b) as for (b, a).
template <class T>
PEPESEG_HD T AddSquare(T a, T b, T sum) {
  const T difference = a - b;
  return MulAdd(difference, difference, sum);
}

// Squared mutual reachability; a distance that is no number is infinite.
template <class T>
PEPESEG_HD T MutualReach(T squared, T core_a, T core_b) {
  const T infinity(INFINITY);
  return Max(Max(core_a, core_b), Select(squared < infinity, squared, infinity));
}

}  // namespace pepeseg
