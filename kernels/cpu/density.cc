#include "kernels/math/density.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "kernels/cpu/cpu_backend.h"
#include "kernels/cpu/load_shape.h"

// Density control: PlanDensity lists the Gaussians that there are next, GatherRows copies them.

namespace pepeseg {
namespace {

constexpr int kNumMoved = 6;  // planes in which a child differs: mean and log scale

// A Gaussian after density control.
struct Row {
  int32_t source;
  bool is_new;
  float moved[kNumMoved];
};

// Mean gradient of a Gaussian over the views that showed it; 0 if none did.
float MeanGradient(const PlanDensityArgs& args, int64_t i) {
  const int32_t views = args.num_visible[i];
  return views == 0 ? 0.0f : args.mean2d_grad_sum[i] / static_cast<float>(views);
}

// The fate of Gaussian i where there is room for all.
DensityFate FateOf(const PlanDensityArgs& args, const DensityBounds& bounds, int64_t i) {
  const ConstGaussianPlanes& planes = args.gaussians;
  float largest = planes.Plane(kLogScalePlane)[i];
  for (int axis = 1; axis < 3; ++axis) {
    largest = std::max(largest, planes.Plane(kLogScalePlane + axis)[i]);
  }
  return FateOf(bounds, planes.Plane(kOpacityPlane)[i], largest, MeanGradient(args, i));
}

// Returns the number by which Gaussians are chosen where there is no room for all: the largest
// first.
float ChoiceKey(const PlanDensityArgs& args, int64_t i) {
  if (!args.draws) return MeanGradient(args, i);
  return DrawKey(args.square_sum[i], args.seed, static_cast<uint32_t>(i));
}

// Keeps the densified Gaussians with the smallest keys as they are if there is not room for all of
// them. Each densified Gaussian takes one more place.
void LimitToRoom(const PlanDensityArgs& args, std::vector<DensityFate>& fates) {
  std::vector<int64_t> densified;
  int64_t num_left = 0;
  for (size_t i = 0; i < fates.size(); ++i) {
    num_left += fates[i] != kFatePruned;
    if (NumRowsOf(fates[i]) == 2) densified.push_back(static_cast<int64_t>(i));
  }
  const auto room = static_cast<size_t>(std::max<int64_t>(0, args.max_count - num_left));
  if (densified.size() <= room) return;
  std::vector<float> key(fates.size());
  for (const int64_t i : densified) key[static_cast<size_t>(i)] = ChoiceKey(args, i);
  // Stable: of equal keys the lower index is densified.
  std::stable_sort(densified.begin(), densified.end(), [&](int64_t a, int64_t b) {
    return key[static_cast<size_t>(a)] > key[static_cast<size_t>(b)];
  });
  for (size_t k = room; k < densified.size(); ++k) fates[densified[k]] = kFateKept;
}

// Appends what becomes of Gaussian i: nothing, itself, itself and a copy or a child, or two
// children. A child depends on the seed, the index and its number only.
void AddRows(const PlanDensityArgs& args, int64_t i, DensityFate fate, std::vector<Row>& rows) {
  const GaussianShape<float> shape = LoadShape(args.gaussians, i);
  const auto source = static_cast<int32_t>(i);
  for (int k = 0; k < NumRowsOf(fate); ++k) {
    Vec3<float> mean = shape.mean, log_scale = shape.log_scale;
    const bool is_child = fate == kFateSplit && (k > 0 || !args.keeps_parent);
    if (is_child) {
      const Vec3<float> normal =
          NormalNumbers<float>(args.seed, static_cast<uint32_t>(i), static_cast<uint32_t>(k));
      mean = ChildMean(shape, normal);
      log_scale = log_scale - Vec3<float>{kLogSplitShrink, kLogSplitShrink, kLogSplitShrink};
    }
    rows.push_back({source,
                    is_child || k > 0,
                    {mean.x, mean.y, mean.z, log_scale.x, log_scale.y, log_scale.z}});
  }
}

// Returns the rows in Morton order of their means within their bounding box; equal codes in their
// order.
std::vector<size_t> MortonOrder(const std::vector<Row>& rows) {
  float min[3], max[3];
  for (int axis = 0; axis < 3; ++axis) {
    min[axis] = std::numeric_limits<float>::infinity();
    max[axis] = -min[axis];
    for (const Row& row : rows) {  // a NaN takes no part
      min[axis] = std::min(min[axis], row.moved[axis]);
      max[axis] = std::max(max[axis], row.moved[axis]);
    }
  }
  const MortonGrid grid = MakeMortonGrid(min, max);
  std::vector<std::pair<uint64_t, size_t>> codes;
  for (size_t i = 0; i < rows.size(); ++i) codes.emplace_back(MortonCode(grid, rows[i].moved), i);
  std::sort(codes.begin(), codes.end());
  std::vector<size_t> order;
  order.reserve(codes.size());
  for (const auto& [code, index] : codes) order.push_back(index);
  return order;
}

}  // namespace

// Serial: density control runs only once in many steps.
void CpuBackend::PlanDensity(const PlanDensityArgs& args) {
  if (failed()) return;
  const DensityBounds bounds =
      MakeDensityBounds(args.min_gradient, args.clone_size, args.min_opacity, args.max_size);
  std::vector<DensityFate> fates;
  for (int64_t i = 0; i < args.gaussians.count; ++i) fates.push_back(FateOf(args, bounds, i));
  LimitToRoom(args, fates);
  std::vector<Row> rows;
  for (size_t i = 0; i < fates.size(); ++i) {
    AddRows(args, static_cast<int64_t>(i), fates[i], rows);
  }
  const auto num = [&](DensityFate fate) { return std::count(fates.begin(), fates.end(), fate); };
  const auto num_rows = static_cast<int64_t>(rows.size());
  *args.counts = {num_rows, num(kFateCloned), num(kFateSplit), num(kFatePruned)};
  if (!args.source->Reserve(*this, num_rows) || !args.is_new->Reserve(*this, num_rows) ||
      !args.mean_log_scale->Reserve(*this, kNumMoved * num_rows)) {
    return;
  }
  int64_t to = 0;
  for (const size_t from : MortonOrder(rows)) {
    args.source->span()[to] = rows[from].source;
    args.is_new->span()[to] = rows[from].is_new ? 1 : 0;
    for (int k = 0; k < kNumMoved; ++k) {
      args.mean_log_scale->span()[k * num_rows + to] = rows[from].moved[k];
    }
    ++to;
  }
}

namespace {

// One plane, or the numbers that go with the Gaussians.
template <class T>
void Gather(const GatherRowsArgs& args, const T* from, T* to) {
  for (int64_t i = 0; i < args.source.size; ++i) {
    assert(args.source[i] >= 0 && args.source[i] < args.from.count);
    const bool zero = !args.is_zero.empty() && args.is_zero[i] != 0;
    to[i] = zero ? T(0) : from[args.source[i]];
  }
}

}  // namespace

// A task is a plane, so that reads stay within one stream of memory.
void CpuBackend::GatherRows(const GatherRowsArgs& args) {
  if (failed()) return;
  assert(args.from.sh_degree == args.to.sh_degree && args.source.size == args.to.count);
  const int num_planes = NumPlanes(args.to.sh_degree);
  pool_.ParallelFor(num_planes + 1, [&](int64_t k, int) {
    const int plane = static_cast<int>(k);
    if (plane < num_planes) {
      Gather(args, args.from.Plane(plane), args.to.Plane(plane));
    } else if (!args.number_to.empty()) {
      Gather(args, args.number_from.data, args.number_to.data);
    }
  });
}

}  // namespace pepeseg
