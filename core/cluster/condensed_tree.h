#pragma once

#include <span>
#include <vector>

#include "kernels/ops/cluster.h"

namespace pepeseg {

inline constexpr int kNoise = -1;

struct Clusters {
  int count = 0;
  std::vector<int> labels;  // [points] 0..count - 1 by their first points, or kNoise
  // [points] how deep in its cluster a point is: 1 at its densest, 0 for noise.
  std::vector<float> strengths;
};

// The flat clusters of HDBSCAN from a minimum spanning tree of n points under mutual reachability,
// its edges ascending (Campello, Moulavi and Sander 2013).
//
// The level of a distance d is lambda = 1 / d. All edges of one length are removed at once, as in
// the paper: the clusters depend neither on which minimum spanning tree it is nor on the order of
// the points. (Implementations that remove them one by one let the order of equal edges decide to
// which side a point between two clusters goes.) Parts of fewer than min_cluster_size points are
// noise from there on; a cluster of which two or more larger parts remain ends, and one of which
// one remains lives on in it. Its stability is the sum over its points of
// lambda(point leaves) - lambda(cluster begins), infinite where points coincide down to the last.
// Clusters are chosen from below: one is kept if it is at least as stable as the best choice below
// it in sum. The root, all points, is never chosen.
Clusters ClustersOf(std::span<const TreeEdge> edges, int min_cluster_size);

}  // namespace pepeseg
