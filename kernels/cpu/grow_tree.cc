#include "kernels/cpu/grow_tree.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

// Prim's algorithm by components. The points outside the tree are kept as columns without gaps, so
// that the SIMD kernel relaxes whole groups of them; a point that joins is replaced by the last
// column. Columns are relaxed in parallel and independently, and the least edge is chosen serially
// by the total order of edges, so the tree depends neither on threads nor on the order of columns.

namespace pepeseg {
namespace {

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
    // Channel c of a column is c * kTreeColumns after its channel 0 (tree_jobs.h).
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

}  // namespace

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

}  // namespace pepeseg
