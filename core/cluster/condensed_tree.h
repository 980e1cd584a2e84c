#pragma once

#include <span>
#include <vector>

#include "kernels/ops/cluster.h"

namespace pepeseg {

inline constexpr int kNoise = -1;  // label of points in no cluster

// A flat clustering.
struct Clusters {
  int count = 0;
  // [points] 0..count - 1, or kNoise. Clusters are numbered in the order of their first points.
  std::vector<int> labels;
  // [points] 1 where a cluster is densest, smaller further out, 0 for noise.
  std::vector<float> strengths;
};

// Returns the flat clusters of HDBSCAN (Campello, Moulavi and Sander 2013) from a minimum spanning
// tree of n points under mutual reachability. edges: [n - 1], ascending, n >= 1.
//
// Edges are removed from the longest to the shortest. The density at a distance d is
// lambda = 1 / d.
// - All edges of one length are removed at once, as in the paper. So the clusters depend neither
//   on which of several minimum spanning trees is given nor on the order of the points.
//   Implementations that remove edges one by one let the order of equal edges decide on which side
//   a point between two clusters falls.
// - Where a cluster falls apart, parts of fewer than min_cluster_size points become noise. If one
//   larger part remains, the cluster continues as that part; if none or several remain, it ends.
// - The stability of a cluster is the sum over its points of
//   lambda(the point leaves it) - lambda(the cluster begins). It is infinite if at least
//   min_cluster_size points have a mutual reachability of 0.
// - Clusters are chosen from the leaves up. A cluster replaces the clusters chosen below it if it
//   is at least as stable as their sum. The root, which is all points, is never chosen.
Clusters ClustersOf(std::span<const TreeEdge> edges, int min_cluster_size);

}  // namespace pepeseg
