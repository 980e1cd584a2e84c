#pragma once

#include <cstdint>
#include <vector>

#include "kernels/ops/cluster.h"

namespace pepeseg {

struct TreeResult {
  std::vector<float> core_squared;
  std::vector<TreeEdge> edges;
};

struct ReferenceEdge {
  double squared;
  int32_t a, b;
};
struct ReferenceTree {
  std::vector<double> core_squared;
  std::vector<ReferenceEdge> edges;
};

// All distances in double, all edges, Kruskal. points [n, 32].
ReferenceTree ReferenceSpanningTree(const std::vector<float>& points, int min_samples);

// Whole numbers in [0, range) in the first num_channels channels, 0 in the others: all distances
// are exact in fp32, and many are equal when the range is small.
std::vector<float> LatticePoints(int count, int num_channels, int range, uint64_t seed);
// Unit vectors around num_clusters directions; every tenth one in a direction of its own.
std::vector<float> ClusteredPoints(int count, int num_clusters, float spread, uint64_t seed);

}  // namespace pepeseg
