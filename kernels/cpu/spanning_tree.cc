#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <vector>

#include "kernels/cpu/cpu_backend.h"
#include "kernels/cpu/simd_kernels.h"
#include "kernels/math/reach.h"
#include "kernels/ops/cluster.h"
#include "kernels/thread_pool.h"

// The minimum spanning tree in three steps (see SpanningTree at the end): nearest neighbours,
// Boruvka's rounds over their lists (JoinNear), and Prim's algorithm by components (GrowTree). In
// the last, the points outside the tree are kept as columns without gaps, so that the SIMD kernel
// relaxes whole groups of them; a point that joins is replaced by the last column. Columns are
// relaxed in parallel and independently, and the least edge is chosen serially by the total order
// of edges, so the tree depends neither on threads nor on the order of columns.

namespace pepeseg {
namespace {

// The total order of edges, see SpanningTreeArgs.
bool ComesBefore(const TreeEdge& one, const TreeEdge& other) {
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

// Runs Boruvka's rounds as long as the lists decide any edge. Usually this is almost all of the
// tree, because the mutual reachability of a point and its neighbours is its core distance, unless
// theirs is larger. All edges it returns are of the minimum spanning tree.
Forest JoinNear(const NeighbourLists& lists) {
  Forest forest;
  forest.component.resize(lists.num_points);
  std::iota(forest.component.begin(), forest.component.end(), 0);
  while (Round(lists, forest)) {
  }
  return forest;
}

struct GrowTreeArgs {
  const float* points;  // [n, 32]
  const float* core;    // [n] squared
  float* columns;       // the points as columns (simd_kernels.h); used as working memory
};

constexpr int32_t kNoPoint = std::numeric_limits<int32_t>::max();

int32_t RoundUp(int32_t count, int32_t multiple) {
  return (count + multiple - 1) / multiple * multiple;
}

// The points outside the tree, as columns [0, count). They are padded with columns that are
// infinitely far from everything. Their edges lead to point -1, which no row is below, so
// relaxing never changes them.
class Outside {
 public:
  Outside(const GrowTreeArgs& args, int32_t count)
      : count_(count), columns_(args.columns), point_(count), place_(count) {
    const int32_t padded = RoundUp(count, kTreeColumns);
    core_.assign(padded, INFINITY);
    std::copy_n(args.core, count, core_.begin());
    reach_.assign(padded, INFINITY);
    from_.assign(padded, -1);
    std::fill_n(from_.begin(), count, kNoPoint);
    std::iota(point_.begin(), point_.end(), 0);
    std::iota(place_.begin(), place_.end(), 0);
  }

  int32_t count() const { return count_; }
  int32_t padded() const { return RoundUp(count_, kTreeColumns); }

  // Moves the last column into the place of `point`.
  void Remove(int32_t point) {
    const int32_t hole = place_[point], last = --count_;
    // Channel c of a column is c * kTreeColumns after its channel 0 (simd_kernels.h).
    const auto channel0 = [&](int32_t column) {
      return columns_ + int64_t{column / kTreeColumns} * kTreeColumns * kFeatureSize +
             column % kTreeColumns;
    };
    for (int channel = 0; channel < kFeatureSize; ++channel) {
      channel0(hole)[channel * kTreeColumns] = channel0(last)[channel * kTreeColumns];
    }
    core_[hole] = core_[last];
    reach_[hole] = reach_[last];
    from_[hole] = from_[last];
    point_[hole] = point_[last];
    place_[point_[hole]] = hole;
    core_[last] = reach_[last] = INFINITY;
    from_[last] = -1;
  }

  // A job over the columns; the rows are still to be set.
  RelaxJob Job() { return {columns_, core_.data(), reach_.data(), from_.data(), {}, {}, {}, 0}; }

  // Returns the least edge between the tree and a point outside, and that point in `joining`.
  TreeEdge LeastEdge(const SimdKernels& simd, int32_t& joining) const {
    const float squared = simd.least_of(reach_.data(), padded());
    TreeEdge least = {squared, kNoPoint, kNoPoint};
    for (int32_t column = 0; column < count_; ++column) {
      if (reach_[column] != squared) continue;
      const int32_t point = point_[column], other = from_[column];
      const TreeEdge edge = {squared, std::min(point, other), std::max(point, other)};
      if (!ComesBefore(edge, least)) continue;
      least = edge;
      joining = point;
    }
    return least;
  }

 private:
  int32_t count_;
  float* columns_;
  std::vector<float> core_, reach_;
  std::vector<int32_t> from_, point_;  // of columns
  std::vector<int32_t> place_;         // point -> column
};

// Points that join the tree, padded to a multiple of kTreeRows with points that are infinitely far
// from everything.
struct Joining {
  std::vector<float> rows, core;
  std::vector<int32_t> points;

  Joining(const GrowTreeArgs& args, std::span<const int32_t> members)
      : points(members.begin(), members.end()) {
    const int32_t padded = RoundUp(static_cast<int32_t>(members.size()), kTreeRows);
    rows.resize(int64_t{padded} * kFeatureSize);
    core.assign(padded, INFINITY);
    points.resize(padded, kNoPoint);
    for (size_t i = 0; i < members.size(); ++i) {
      std::copy_n(args.points + int64_t{members[i]} * kFeatureSize, kFeatureSize,
                  rows.begin() + static_cast<int64_t>(i) * kFeatureSize);
      core[i] = args.core[members[i]];
    }
  }
};

// Shortens the edges from all points outside to the tree by way of the points that join.
void Relax(const Joining& joining, const SimdKernels& simd, ThreadPool& pool, Outside& outside) {
  RelaxJob job = outside.Job();
  job.rows = joining.rows.data();
  job.row_core = joining.core.data();
  job.row_points = joining.points.data();
  job.num_rows = static_cast<int>(joining.points.size());
  // Waking the pool takes as long as some thousands of pairs, so small jobs run on this thread.
  constexpr int32_t kPairsOfTask = 65536;
  const int32_t padded = outside.padded();
  const int32_t width = RoundUp(kPairsOfTask / job.num_rows + 1, kTreeColumns);
  if (width >= padded) return simd.relax_columns(job, {0, padded});
  pool.ParallelFor((padded + width - 1) / width, [&](int64_t i, int) {
    const int32_t first = static_cast<int32_t>(i) * width;
    simd.relax_columns(job, {first, std::min(padded, first + width)});
  });
}

// The points of each component, in spans of `points` by the component's name.
struct Members {
  std::vector<int32_t> points, first;

  explicit Members(const std::vector<int32_t>& component)
      : points(component.size()), first(component.size() + 1) {
    for (const int32_t name : component) ++first[name + 1];
    std::partial_sum(first.begin(), first.end(), first.begin());
    std::vector<int32_t> next(first.begin(), first.end() - 1);
    for (size_t i = 0; i < component.size(); ++i) {
      points[next[component[i]]++] = static_cast<int32_t>(i);
    }
  }
  std::span<const int32_t> Of(int32_t name) const {
    return std::span(points).subspan(first[name], first[name + 1] - first[name]);
  }
};

// Completes a forest of edges of the minimum spanning tree by Prim's algorithm, which adds a whole
// component at a time, so that each pair of points of different components is examined once.
// Appends to forest.edges, in no particular order.
// Starts with the component of point 0 and ends when no point is outside.
void GrowTree(const GrowTreeArgs& args, const SimdKernels& simd, ThreadPool& pool, Forest& forest) {
  const auto num_points = static_cast<int32_t>(forest.component.size());
  const Members members(forest.component);
  Outside outside(args, num_points);
  int32_t next = 0;
  while (true) {
    const std::span<const int32_t> component = members.Of(forest.component[next]);
    for (const int32_t point : component) outside.Remove(point);
    if (outside.count() == 0) return;
    Relax(Joining(args, component), simd, pool, outside);
    forest.edges.push_back(outside.LeastEdge(simd, next));
  }
}

// Neighbours beyond those that the core distance needs: with them the lists decide more of the
// tree, without examining all pairs.
constexpr int kMoreNeighbours = 3;

// Transposes the points of one group to columns (simd_kernels.h).
void GroupColumns(const float* points, int32_t num_points, int32_t group, float* columns) {
  const int32_t first = group * kTreeColumns, end = std::min(num_points, first + kTreeColumns);
  float* to = columns + int64_t{first} * kFeatureSize;
  for (int32_t point = first; point < end; ++point) {
    for (int channel = 0; channel < kFeatureSize; ++channel) {
      to[channel * kTreeColumns + point - first] = points[int64_t{point} * kFeatureSize + channel];
    }
  }
}

}  // namespace

// Finds the nearest neighbours of all points (in parallel, n^2 distances), the part of the tree
// that they decide (JoinNear), and the rest by Prim's algorithm from component to component
// (GrowTree). Prim's algorithm from point to point examines each pair once, too, but reads all
// points for each point: twice the time.
void CpuBackend::SpanningTree(const SpanningTreeArgs& args) {
  if (failed()) return;
  assert(args.min_samples >= 1 && args.min_samples <= kMaxMinSamples);
  const auto num_points = static_cast<int32_t>(args.points.size / kFeatureSize);
  const int num_nearest = args.min_samples - 1 + kMoreNeighbours;
  const int32_t num_groups = (num_points + kTreeColumns - 1) / kTreeColumns;
  Buffer<float> columns(*this, int64_t{num_groups} * kTreeColumns * kFeatureSize);
  Buffer<Neighbour> nearest(*this, int64_t{num_points} * num_nearest);
  if (failed() || num_points == 0) return;

  // The last group is padded with zeros, which are never taken for points.
  float* column = columns.span().data;
  pool_.ParallelFor(num_groups, [&](int64_t group, int) {
    GroupColumns(args.points.data, num_points, static_cast<int32_t>(group), column);
  });
  const NearestJob job = {args.points.data, column, num_points, num_nearest, nearest.span().data};
  pool_.ParallelFor((num_points + kNearestRows - 1) / kNearestRows, [&](int64_t i, int) {
    const int64_t first = i * kNearestRows;
    simd_.nearest_neighbours(job, {first, std::min<int64_t>(num_points, first + kNearestRows)});
  });
  for (int32_t point = 0; point < num_points; ++point) {
    // The point itself is the first of the min_samples, so its list starts with the second.
    const Neighbour* list = job.nearest + int64_t{point} * num_nearest;
    args.core_squared[point] = args.min_samples == 1 ? 0 : list[args.min_samples - 2].squared;
  }
  // Edges are found in no particular order, but their set is unique.
  Forest forest = JoinNear({num_nearest, num_points, job.nearest, args.core_squared.data});
  GrowTree({args.points.data, args.core_squared.data, column}, simd_, pool_, forest);
  assert(static_cast<int64_t>(forest.edges.size()) == num_points - 1);
  std::sort(forest.edges.begin(), forest.edges.end(), ComesBefore);
  std::copy(forest.edges.begin(), forest.edges.end(), args.edges.data);
}

}  // namespace pepeseg
