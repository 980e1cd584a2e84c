#pragma once

#include <cstdint>
#include <vector>

#include "kernels/ops/cluster.h"

namespace pepeseg {

// Result of SpanningTree on the host.
struct TreeResult {
  std::vector<float> core_squared;
  std::vector<TreeEdge> edges;
};

struct ReferenceEdge {
  double squared;
  int32_t a, b;
};
// The tree in double, edges ascending.
struct ReferenceTree {
  std::vector<double> core_squared;
  std::vector<ReferenceEdge> edges;
};

// Computes the tree of points [n, 32] by Kruskal's algorithm on all edges, in double.
ReferenceTree ReferenceSpanningTree(const std::vector<float>& points, int min_samples);

// Returns points with random integers in [0, range) in the first num_channels channels and 0 in the
// others. All squared distances are exact in fp32, and many are equal when the range is small.
std::vector<float> LatticePoints(int count, int num_channels, int range, uint64_t seed);
// Returns unit vectors around num_clusters random directions; every tenth one is in a random
// direction.
std::vector<float> ClusteredPoints(int count, int num_clusters, float spread, uint64_t seed);

}  // namespace pepeseg
