#pragma once

#include <cstdint>

#include "kernels/buffer.h"
#include "kernels/ops/render.h"

// Arguments of the step that clustering asks of a device (HDBSCAN: Campello, Moulavi and Sander
// 2013). What follows it is small and stands in core/cluster.

namespace pepeseg {

inline constexpr int kMaxMinSamples = 32;

// Distances are given squared: a root would round different ones to the same, and ties count.
struct TreeEdge {
  float squared;  // mutual reachability: max(core_a, core_b, distance), squared
  int32_t a, b;   // a < b
};

// Core distances of points, and their minimum spanning tree under mutual reachability.
//
// A point's core distance is that to its min_samples-th nearest neighbour, itself counted as the
// first: 0 for min_samples = 1, infinite where there are not so many points. Distances are sums of
// (a - b)^2 in fp32, exactly symmetric; one that is not a finite number counts as infinite, so a
// row with a NaN is infinitely far from all others. The order of edges by (squared, a, b) is total
// and makes the tree unique, infinite edges included. Exact; memory in proportion to the points.
struct SpanningTreeArgs {
  DeviceSpan<const float> points;  // [n, 32], n < 2^31
  int min_samples = 5;             // 1..kMaxMinSamples
  DeviceSpan<float> core_squared;  // [n]
  DeviceSpan<TreeEdge> edges;      // [n - 1] ascending; none for n < 2
};

}  // namespace pepeseg
