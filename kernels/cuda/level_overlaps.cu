#include <cuda_runtime.h>

#include <algorithm>

#include "kernels/cuda/cuda_backend.h"
#include "kernels/cuda/launch.h"
#include "kernels/cuda/pixel_feature.cuh"

// LevelOverlaps (LevelOverlapsArgs in kernels/ops/feature.h; METHOD.md section 4): the threshold
// level of each pixel at each scale, and how many pixels have each pair of levels at each pair of
// scales. Two launches, ordered by the stream:
//   LevelKernel    a thread has a pixel at scale blockIdx.y; gated queries are in up to 32 KiB of
//                  dynamic shared memory (GateQueries)
//   OverlapKernel  blockIdx.y is the first scale; a thread takes every k-th pixel and counts it
//                  against all scales from the first on. A block clears its counts in shared
//                  memory (up to 32 KiB), counts there by atomics, and adds the counts to the
//                  output by atomics, with __syncthreads between the three
// Counts are integers, so they are the same in every run.

namespace pepeseg {
namespace {

constexpr int kBlock = 256;

struct LevelParams {
  const uint4* map;  // [num_pixels, 32] halves
  const float* psi;  // [num_scales, 32]
  const float* queries;
  int64_t num_pixels;
  int num_queries, num_positive;
  const float* thresholds;
  int num_thresholds;
  float min_norm;
  uint8_t* levels;  // [num_scales, num_pixels]
};

// Writes the threshold levels.
__global__ void __launch_bounds__(kBlock) LevelKernel(LevelParams p) {
  extern __shared__ float queries[];  // [num_queries, 32]
  __shared__ float psi2[kFeatureSize];
  const int scale = static_cast<int>(blockIdx.y);
  GateQueries<kBlock>(p.psi + scale * kFeatureSize, p.queries, p.num_queries, psi2, queries);
  const int64_t pixel = int64_t{blockIdx.x} * kBlock + threadIdx.x;
  if (pixel >= p.num_pixels) return;
  const PixelFeature f = LoadPixelFeature(p.map, pixel, psi2, p.min_norm);
  const BestCosines best = BestCosinesTo(f, queries, p.num_queries, p.num_positive);
  int level = 0;
  for (int t = 0; t < p.num_thresholds; ++t) level += best.positive > p.thresholds[t] ? 1 : 0;
  p.levels[scale * p.num_pixels + pixel] =
      static_cast<uint8_t>(best.positive > best.negative ? level : 0);
}

struct OverlapParams {
  const uint8_t* levels;  // [num_scales, num_pixels]
  int64_t num_pixels;
  int num_scales, side;  // side: number of levels, thresholds + 1
  int32_t* overlaps;     // [num_scales, num_scales, side, side], zeros
};

// Counts pixels by their levels at scale blockIdx.y and at each scale from it on.
__global__ void __launch_bounds__(kBlock) OverlapKernel(OverlapParams p) {
  extern __shared__ int32_t counts[];  // [num_scales - scale, side, side]
  const int scale = static_cast<int>(blockIdx.y), square = p.side * p.side;
  const int size = (p.num_scales - scale) * square;
  for (int i = static_cast<int>(threadIdx.x); i < size; i += kBlock) counts[i] = 0;
  __syncthreads();
  const int64_t stride = int64_t{gridDim.x} * kBlock;
  for (int64_t i = int64_t{blockIdx.x} * kBlock + threadIdx.x; i < p.num_pixels; i += stride) {
    const int level = p.levels[scale * p.num_pixels + i];
    for (int b = scale; b < p.num_scales; ++b) {
      const int other = p.levels[b * p.num_pixels + i];
      if ((level | other) == 0) continue;
      atomicAdd(&counts[(b - scale) * square + level * p.side + other], 1);
    }
  }
  __syncthreads();
  int32_t* row = p.overlaps + (int64_t{scale} * p.num_scales + scale) * square;
  for (int i = static_cast<int>(threadIdx.x); i < size; i += kBlock) {
    if (counts[i] != 0) atomicAdd(&row[i], counts[i]);
  }
}

}  // namespace

void CudaBackend::LevelOverlaps(const LevelOverlapsArgs& args) {
  const Turn turn(*this);
  if (!turn) return;
  Keep(cudaMemsetAsync(args.overlaps.data, 0, args.overlaps.size * sizeof(int32_t), stream_),
       "clearing overlaps");
  const int64_t num_pixels = args.map.size / kFeatureSize;
  if (num_pixels == 0) return;
  const auto num_scales = static_cast<unsigned>(args.psi.size / kFeatureSize);
  const auto num_thresholds = static_cast<int>(args.thresholds.size);
  const int side = num_thresholds + 1;
  LevelKernel<<<dim3(NumBlocks(num_pixels, kBlock), num_scales), kBlock,
                args.queries.size * sizeof(float), stream_>>>(
      {reinterpret_cast<const uint4*>(args.map.data), args.psi.data, args.queries.data, num_pixels,
       static_cast<int>(args.queries.size / kFeatureSize), args.num_positive, args.thresholds.data,
       num_thresholds, args.min_norm, args.levels.data});
  Launched("levels");
  constexpr int kMostBlocks = 32;  // blocks a scale; each adds its counts to the output once
  OverlapKernel<<<dim3(std::min(kMostBlocks, NumBlocks(num_pixels, kBlock)), num_scales), kBlock,
                  num_scales * side * side * sizeof(int32_t), stream_>>>(
      {args.levels.data, num_pixels, static_cast<int>(num_scales), side, args.overlaps.data});
  Launched("level overlaps");
}

}  // namespace pepeseg
