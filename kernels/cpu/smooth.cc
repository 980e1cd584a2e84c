#include <algorithm>
#include <bit>
#include <cassert>

#include "kernels/cpu/cpu_backend.h"

namespace pepeseg {
namespace {

constexpr int64_t kChunk = 256;  // Gaussians of a task

}  // namespace

// All rows have the same number of entries, so their places are known. A task is a group.
void CpuBackend::NeighborRows(const NeighborRowsArgs& args) {
  if (failed()) return;
  const int64_t count = args.gaussian.size;
  const int bits = args.drawn.empty() ? 0 : std::popcount(args.drawn[0]);
  if (!args.row_first->Reserve(*this, count + 1) ||
      !args.row_gaussian->Reserve(*this, count * bits)) {
    return;
  }
  int32_t* row_first = args.row_first->span().data;
  assert(row_first != nullptr);
  for (int64_t i = 0; i <= count; ++i) row_first[i] = static_cast<int32_t>(i * bits);
  const auto num_groups = static_cast<int64_t>(args.drawn.size());
  pool_.ParallelFor(num_groups, [&](int64_t group, int) {
    assert(std::popcount(args.drawn[group]) == bits);
    // The set bits of the draw are the columns of the graph that take part.
    for (int64_t i = args.group_first[group]; i < args.group_first[group + 1]; ++i) {
      const int32_t* neighbors =
          args.graph.neighbor.data + int64_t{args.gaussian[i]} * args.graph.num_neighbors;
      int32_t* out = args.row_gaussian->span().data + i * bits;
      for (uint32_t left = args.drawn[group]; left != 0; left &= left - 1) {
        *out++ = neighbors[std::countr_zero(left)];
      }
    }
  });
}

// Each Gaussian gathers from its neighbours.
void CpuBackend::SmoothFeatures(const SmoothFeaturesArgs& args) {
  if (failed()) return;
  const int64_t count = args.gaussian.empty() ? args.inv_length.size : args.gaussian.size;
  pool_.ParallelFor((count + kChunk - 1) / kChunk, [&](int64_t i, int) {
    simd_.smooth_features(args, {i * kChunk, std::min(count, (i + 1) * kChunk)});
  });
}

// Each touched Gaussian gathers from the sampled pixels of its column.
void CpuBackend::SmoothBackward(const SmoothBackwardArgs& args) {
  if (failed()) return;
  const int64_t count = args.columns.gaussian.size;
  pool_.ParallelFor((count + kChunk - 1) / kChunk, [&](int64_t i, int) {
    simd_.smooth_backward(args, {i * kChunk, std::min(count, (i + 1) * kChunk)});
  });
}

}  // namespace pepeseg
