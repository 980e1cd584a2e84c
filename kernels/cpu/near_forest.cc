#include "kernels/cpu/near_forest.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "kernels/math/reach.h"

namespace pepeseg {
namespace {

// Bounds that the lists give on the edges that leave a component.
struct Leaving {
  TreeEdge least = {INFINITY, -1, -1};  // the least edge in the lists
  float others = INFINITY;              // lower bound of all edges not in the lists, squared
};

// Returns the edges that leave each component, at the index of its name. An edge that is not in the
// list of a point is at least as long as the last of the list.
std::vector<Leaving> EdgesLeaving(const NeighbourLists& lists,
                                  const std::vector<int32_t>& component) {
  std::vector<Leaving> leaving(lists.num_points);
  for (int32_t point = 0; point < lists.num_points; ++point) {
    Leaving& own = leaving[component[point]];
    const Neighbour* list = lists.nearest + int64_t{point} * lists.k;
    // Lists are ascending, so their last entry bounds all points that are not in them.
    own.others = std::min(own.others, list[lists.k - 1].squared);
    for (int i = 0; i < lists.k; ++i) {
      const int32_t other = list[i].point;
      // Distances ascend, and an edge is never shorter than its distance.
      if (other < 0 || list[i].squared > own.least.squared) break;
      if (component[other] == component[point]) continue;
      const float squared = MutualReach(list[i].squared, lists.core[point], lists.core[other]);
      const TreeEdge edge = {squared, std::min(point, other), std::max(point, other)};
      if (ComesBefore(edge, own.least)) own.least = edge;
    }
  }
  return leaving;
}

// Returns the root of a point in the union-find forest, halving the path.
int32_t RootOf(std::vector<int32_t>& parent, int32_t point) {
  while (parent[point] != point) point = parent[point] = parent[parent[point]];
  return point;
}

// One round of Boruvka: adds the least edge of each component for which the lists prove it. Returns
// false if there was none.
bool Round(const NeighbourLists& lists, Forest& forest) {
  const size_t before = forest.edges.size();
  std::vector<int32_t>& component = forest.component;
  std::vector<int32_t> parent(lists.num_points);
  std::iota(parent.begin(), parent.end(), 0);
  for (const Leaving& leaving : EdgesLeaving(lists, component)) {
    // Strictly less: an equal edge outside the lists might join lower points and come first.
    if (!(leaving.least.squared < leaving.others)) continue;
    const int32_t a = RootOf(parent, component[leaving.least.a]);
    const int32_t b = RootOf(parent, component[leaving.least.b]);
    if (a == b) continue;  // the other component chose the same edge
    parent[std::max(a, b)] = std::min(a, b);
    forest.edges.push_back(leaving.least);
  }
  // Renames the components; a name is always the lowest of its points.
  for (int32_t& root : component) root = RootOf(parent, root);
  return forest.edges.size() > before;
}

}  // namespace

Forest JoinNear(const NeighbourLists& lists) {
  Forest forest;
  forest.component.resize(lists.num_points);
  std::iota(forest.component.begin(), forest.component.end(), 0);
  while (Round(lists, forest)) {
  }
  return forest;
}

}  // namespace pepeseg
