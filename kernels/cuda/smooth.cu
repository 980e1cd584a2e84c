#include <cuda_runtime.h>

#include <bit>

#include "kernels/cuda/channel.cuh"
#include "kernels/cuda/cuda_backend.h"
#include "kernels/math/feature.h"

// NeighborRows, SmoothFeatures and SmoothBackward (kernels/ops/smooth.h; METHOD.md section 3,
// "Smoothing"; formulas in kernels/math/feature.h).
//
// NeighborRowsKernel: one thread per Gaussian lists its drawn neighbours. SmoothKernel and
// BackwardKernel: one warp per Gaussian, one lane per channel; norms and dot products are shuffles
// over the warp (channel.cuh). Blocks are eight warps that share nothing, and there are no atomics:
// a Gaussian is summed by one warp, over its neighbours or its column in their order, so results
// are the same in every run.

namespace pepeseg {
namespace {

constexpr int kBlock = 256;
constexpr int kWarps = kBlock / 32;

// All groups draw the same number `bits` of neighbours, so that rows have a fixed length.
struct NeighborRowsParams {
  NeighborGraph graph;
  DeviceSpan<const int32_t> gaussian;
  DeviceSpan<const int32_t> group_first;
  const uint32_t* drawn;  // [groups]
  int bits;
  int32_t *row_first, *row_gaussian;
};
__global__ void __launch_bounds__(kBlock) NeighborRowsKernel(NeighborRowsParams p) {
  const int64_t i = int64_t{blockIdx.x} * kBlock + threadIdx.x;
  if (i > p.gaussian.size) return;
  p.row_first[i] = static_cast<int32_t>(i * p.bits);
  if (i == p.gaussian.size) return;
  const int32_t* neighbors =
      p.graph.neighbor.data + int64_t{p.gaussian.data[i]} * p.graph.num_neighbors;
  int32_t* out = p.row_gaussian + i * p.bits;
  for (uint32_t left = p.drawn[GroupOf(p.group_first, i)]; left != 0; left &= left - 1) {
    *out++ = neighbors[__ffs(static_cast<int>(left)) - 1];
  }
}

// The draw is the same for all Gaussians, so all lanes take the same branches. Lane k holds the
// index of neighbour k.
constexpr int kAtOnce = 8;  // loads of features in flight at once
__global__ void __launch_bounds__(kBlock) SmoothKernel(SmoothFeaturesArgs args, int64_t count) {
  const int64_t i = int64_t{blockIdx.x} * kWarps + threadIdx.x / 32;
  if (i >= count) return;
  const int64_t gaussian = args.gaussian.size == 0 ? i : args.gaussian.data[i];
  const int lane = static_cast<int>(threadIdx.x) % 32;
  const int32_t* neighbors = args.graph.neighbor.data + gaussian * args.graph.num_neighbors;
  const int32_t of_lane = lane < args.graph.num_neighbors ? neighbors[lane] : 0;
  Channel sum(0);
  uint32_t left = args.drawn;
  while (left != 0) {
    float feature[kAtOnce];
#pragma unroll
    for (int k = 0; k < kAtOnce; ++k) {
      const int column = left == 0 ? 0 : __ffs(static_cast<int>(left)) - 1;
      const int64_t neighbor = __shfl_sync(~0u, of_lane, column);
      feature[k] = left == 0 ? 0.0f : args.features.data[neighbor * kFeatureSize + lane];
      left &= left - 1;
    }
#pragma unroll
    for (int k = 0; k < kAtOnce; ++k) {
      const Channel one(feature[k]);
      Channel direction(0);
      Direction(&one, 1, &direction);
      sum = sum + direction;
    }
  }
  Channel smoothed(0);
  const Channel inv_length = Direction(&sum, 1, &smoothed);
  args.smoothed.data[gaussian * kFeatureSize + lane] = smoothed.v;
  if (lane == 0) args.inv_length.data[gaussian] = inv_length.v;
}

// Gathers the gradient of fbar over the column and passes it through the normalisation.
__global__ void __launch_bounds__(kBlock) BackwardKernel(SmoothBackwardArgs args) {
  const int64_t i = int64_t{blockIdx.x} * kWarps + threadIdx.x / 32;
  if (i >= args.columns.gaussian.size) return;
  const int lane = static_cast<int>(threadIdx.x) % 32;
  const int64_t gaussian = args.columns.gaussian.data[i];
  const Channel smoothed(args.smoothed.data[gaussian * kFeatureSize + lane]);
  const Channel inv_length(args.inv_length.data[gaussian]);
  Channel grad(WeightedSum<16>(ColumnOf(args.columns, i), args.pixel_grad.data, lane));
  DirectionVjp(&smoothed, inv_length, 1, &grad);
  args.sum_grad.data[i * kFeatureSize + lane] = grad.v;
}

}  // namespace

void CudaBackend::NeighborRows(const NeighborRowsArgs& args) {
  const Turn turn(*this);
  if (!turn) return;
  const int64_t count = args.gaussian.size;
  const int bits = args.drawn.empty() ? 0 : std::popcount(args.drawn[0]);
  args.row_first->Reserve(*this, count + 1);
  args.row_gaussian->Reserve(*this, count * bits);
  const auto num_groups = static_cast<int64_t>(args.drawn.size());
  const auto take = [&](Arena& arena) {
    return std::pair(arena.Take<int32_t>(num_groups + 1), arena.Take<uint32_t>(num_groups));
  };
  Arena sizes;
  take(sizes);
  Arena arena(Temporary(sizes.num_bytes()));
  const auto [group_first, drawn] = take(arena);
  if (!error_.empty() || num_groups == 0) return;
  CopyFromHost(group_first, args.group_first.data(), args.group_first.size_bytes());
  CopyFromHost(drawn, args.drawn.data(), args.drawn.size_bytes());
  NeighborRowsKernel<<<NumBlocks(count + 1, kBlock), kBlock, 0, stream_>>>(
      {args.graph,
       args.gaussian,
       {group_first, num_groups + 1},
       drawn,
       bits,
       args.row_first->span().data,
       args.row_gaussian->span().data});
  Launched("neighbor rows");
}

void CudaBackend::SmoothFeatures(const SmoothFeaturesArgs& args) {
  const Turn turn(*this);
  const int64_t count = args.gaussian.size == 0 ? args.inv_length.size : args.gaussian.size;
  if (!turn || count == 0) return;
  SmoothKernel<<<NumBlocks(count, kWarps), kBlock, 0, stream_>>>(args, count);
  Launched("smooth features");
}

void CudaBackend::SmoothBackward(const SmoothBackwardArgs& args) {
  const Turn turn(*this);
  const int64_t count = args.columns.gaussian.size;
  if (!turn || count == 0) return;
  BackwardKernel<<<NumBlocks(count, kWarps), kBlock, 0, stream_>>>(args);
  Launched("smooth backward");
}

}  // namespace pepeseg
