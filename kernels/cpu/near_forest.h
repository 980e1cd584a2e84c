#pragma once

#include <cstdint>
#include <vector>

#include "kernels/cpu/tree_jobs.h"
#include "kernels/ops/cluster.h"

namespace pepeseg {

inline bool ComesBefore(const TreeEdge& one, const TreeEdge& other) {
  if (one.squared != other.squared) return one.squared < other.squared;
  return one.a != other.a ? one.a < other.a : one.b < other.b;
}

// The k nearest others of each point, ascending.
struct NeighbourLists {
  int k;
  int32_t num_points;
  const Neighbour* nearest;  // [num_points, k]
  const float* core;         // [num_points] squared
};

// A part of the minimum spanning tree: its edges, and the component of each point, which is named
// by one of its points.
struct Forest {
  std::vector<TreeEdge> edges;
  std::vector<int32_t> component;
};

// Boruvka's rounds as far as the lists decide them: usually almost all of the tree, because a point
// is as far from all its neighbours as its core distance, unless theirs is larger.
Forest JoinNear(const NeighbourLists& lists);

}  // namespace pepeseg
