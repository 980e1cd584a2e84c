#pragma once

#include <cstdint>

#include "kernels/buffer.h"
#include "kernels/ops/render.h"

// Arguments of the one step of clustering that runs on a device (HDBSCAN: Campello, Moulavi and
// Sander 2013). The steps after it are cheap and run on the host, in core/cluster.

namespace pepeseg {

inline constexpr int kMaxMinSamples = 32;

// An edge of the spanning tree. Distances stay squared: a square root would round different ones to
// the same value, and ties matter.
struct TreeEdge {
  float squared;  // squared mutual reachability: max(core_a, core_b, distance)^2
  int32_t a, b;   // points, a < b
};

// Core distances of points, and their minimum spanning tree under mutual reachability.
//
// The core distance of a point is the distance to its min_samples-th nearest neighbour, where the
// point itself is the first: 0 for min_samples = 1, infinite if there are fewer points. A squared
// distance is the sum of (a - b)^2 in fp32, exactly symmetric. One that is not a finite number
// counts as infinite, so a point with a NaN is infinitely far from all others. The order of edges
// by (squared, a, b) is total and makes the tree unique, infinite edges included. Exact.
//
// Memory grows linearly with n, time with n^2 at worst. The CUDA backend fails for n > 2^20 or a
// min_samples out of range.
struct SpanningTreeArgs {
  DeviceSpan<const float> points;  // [n, 32], n < 2^31
  int min_samples = 5;             // 1..kMaxMinSamples
  DeviceSpan<float> core_squared;  // [n] squared core distances
  DeviceSpan<TreeEdge> edges;      // [n - 1] ascending; empty for n < 2
};

}  // namespace pepeseg
