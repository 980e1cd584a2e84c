#pragma once

#include <cstdint>
#include <vector>

#include "kernels/cpu/tree_jobs.h"
#include "kernels/ops/cluster.h"

namespace pepeseg {

// The total order of edges, see SpanningTreeArgs.
inline bool ComesBefore(const TreeEdge& one, const TreeEdge& other) {
  if (one.squared != other.squared) return one.squared < other.squared;
  return one.a != other.a ? one.a < other.a : one.b < other.b;
}

// The k nearest other points of each point, by ascending distance.
struct NeighbourLists {
  int k;
  int32_t num_points;
  const Neighbour* nearest;  // [num_points, k]
  const float* core;         // [num_points] squared
};

// A part of the minimum spanning tree.
struct Forest {
  std::vector<TreeEdge> edges;
  std::vector<int32_t> component;  // [num_points] named by one of its points
};

// Runs Boruvka's rounds as long as the lists decide any edge. Usually this is almost all of the
// tree, because the mutual reachability of a point and its neighbours is its core distance, unless
// theirs is larger. All edges it returns are of the minimum spanning tree.
Forest JoinNear(const NeighbourLists& lists);

}  // namespace pepeseg
