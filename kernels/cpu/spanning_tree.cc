#include <algorithm>
#include <cassert>

#include "kernels/cpu/cpu_backend.h"
#include "kernels/cpu/grow_tree.h"
#include "kernels/cpu/near_forest.h"

namespace pepeseg {
namespace {

// Neighbours beyond those that the core distance needs: with them the lists decide more of the
// tree, without examining all pairs.
constexpr int kMoreNeighbours = 3;

// Transposes the points of one group to columns (tree_jobs.h).
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
