#include <cuda_fp16.h>
#include <cuda_runtime.h>

#include <algorithm>
#include <cstdint>

#include "kernels/cuda/cuda_backend.h"
#include "kernels/ops/similarity.h"

// Similarity, SegmentPixels and LevelOverlaps (kernels/ops/similarity.h; METHOD.md section 4):
// cosines of the pixels of a cached feature map with queries. Each kernel but OverlapKernel has
// one thread per pixel, whose 32 channels are in registers; the block keeps the gated queries in
// shared memory:
//   cos(psi f, psi q) = sum_k f_k (psi_k^2 q_k / |psi q|) / |psi f|.
// Channels are summed by one thread in their order: the same in every run.
//
// Similarity: the cosine of each pixel to each query. A block owns 256 pixels and up to 32 queries
// (blockIdx.y). It first gates its queries into shared memory, one warp per query, and meets at
// __syncthreads; after it threads share nothing.
//
// SegmentPixels: the mask of a query. One thread per pixel. The block first gates all queries, at
// most 256, into 32 KiB of dynamic shared memory (GateQueries, which ends with __syncthreads).
// Counts and similarities are added over the warp and then by one atomic per warp; similarities are
// rounded to integers first, so the sums are exact in any order and the same in every run.
//
// PackMask: one thread per pixel; a warp's ballot is a word.
//
// LevelOverlaps: the threshold level of each pixel at each scale, and how many pixels have each
// pair of levels at each pair of scales. Two launches, ordered by the stream:
//   LevelKernel    one thread per pixel at scale blockIdx.y; gated queries are in up to 32 KiB of
//                  dynamic shared memory (GateQueries)
//   OverlapKernel  blockIdx.y is the first scale; a thread takes every k-th pixel and counts it
//                  against all scales from the first on. A block clears its counts in shared
//                  memory (up to 32 KiB), counts there by atomics, and adds the counts to the
//                  output by atomics, with __syncthreads between the three
// Counts are integers, so they are the same in every run.

namespace pepeseg {
namespace {

constexpr int kBlock = 256;

// Feature f of a pixel.
struct PixelFeature {
  float value[kFeatureSize];
  float inv_norm;  // 1 / |psi f|; 0 where |f| < min_norm, or where psi f is 0
};

// Loads a pixel. map: [num_pixels, 32] halves, four words of eight. psi2: [32] psi^2.
__device__ PixelFeature LoadPixelFeature(const uint4* map, int64_t pixel, const float* psi2,
                                         float min_norm) {
  PixelFeature f;
#pragma unroll
  for (int word = 0; word < kFeatureSize / 8; ++word) {
    const uint4 bits = map[pixel * (kFeatureSize / 8) + word];
    const uint32_t pairs[4] = {bits.x, bits.y, bits.z, bits.w};
#pragma unroll
    for (int k = 0; k < 4; ++k) {
      const float2 two = __half22float2(reinterpret_cast<const __half2&>(pairs[k]));
      f.value[8 * word + 2 * k] = two.x;
      f.value[8 * word + 2 * k + 1] = two.y;
    }
  }
  float squares = 0, norm2 = 0;
#pragma unroll
  for (int k = 0; k < kFeatureSize; ++k) {
    squares += f.value[k] * f.value[k];
    norm2 += psi2[k] * f.value[k] * f.value[k];
  }
  f.inv_norm = norm2 > 0 && squares >= min_norm * min_norm ? rsqrtf(norm2) : 0.0f;
  return f;
}

// Cosine to one gated query, [32]. 0 where inv_norm is 0.
__device__ float CosineTo(const PixelFeature& f, const float* gated_query) {
  float dot = 0;
#pragma unroll
  for (int k = 0; k < kFeatureSize; ++k) dot += f.value[k] * gated_query[k];
  return dot * f.inv_norm;
}

// Returns one channel of psi^2 q / |psi q|, or 0 for psi q = 0. Called by a whole warp, a channel a
// lane.
__device__ float GateQuery(float psi, float query) {
  const float gated = psi * query;
  float norm2 = gated * gated;
  for (int offset = 16; offset > 0; offset /= 2) norm2 += __shfl_xor_sync(~0u, norm2, offset);
  return norm2 > 0 ? psi * gated * rsqrtf(norm2) : 0.0f;
}

// Writes psi^2 [32] and the gated queries [num_queries, 32] to shared memory. Called by all
// threads of a block; they may read both when it returns, as it ends with __syncthreads.
__device__ void GateQueries(const float* psi_of, const float* queries, int num_queries, float* psi2,
                            float* gated) {
  const int lane = static_cast<int>(threadIdx.x) % 32;
  const float psi = psi_of[lane];
  if (threadIdx.x < 32) psi2[lane] = psi * psi;
  for (int q = static_cast<int>(threadIdx.x) / 32; q < num_queries; q += kBlock / 32) {
    gated[q * kFeatureSize + lane] = GateQuery(psi, queries[q * kFeatureSize + lane]);
  }
  __syncthreads();
}

// The largest cosine to the first num_positive queries, and to the others; -infinity where there
// are none.
struct BestCosines {
  float positive = -INFINITY, negative = -INFINITY;
};
__device__ BestCosines BestCosinesTo(const PixelFeature& f, const float* gated, int num_queries,
                                     int num_positive) {
  BestCosines found;
  for (int q = 0; q < num_queries; ++q) {
    float& best = q < num_positive ? found.positive : found.negative;
    best = fmaxf(best, CosineTo(f, gated + q * kFeatureSize));
  }
  return found;
}

constexpr int kQueriesAtOnce = 32;  // queries of a block

struct SimilarityParams {
  const uint4* map;  // [num_pixels, 32] halves: four words of eight
  const float* psi;
  const float* queries;
  int64_t num_pixels;
  int num_queries;
  float min_norm;
  float* similarity;
};

__global__ void __launch_bounds__(kBlock) SimilarityKernel(SimilarityParams p) {
  __shared__ float psi2[kFeatureSize];
  __shared__ float query[kQueriesAtOnce][kFeatureSize];
  const int first = static_cast<int>(blockIdx.y) * kQueriesAtOnce;
  const int num_queries = min(kQueriesAtOnce, p.num_queries - first);
  const int lane = static_cast<int>(threadIdx.x) % 32;
  const float psi = p.psi[lane];
  if (threadIdx.x < 32) psi2[lane] = psi * psi;
  for (int q = static_cast<int>(threadIdx.x) / 32; q < num_queries; q += kBlock / 32) {
    query[q][lane] = GateQuery(psi, p.queries[int64_t{first + q} * kFeatureSize + lane]);
  }
  __syncthreads();
  const int64_t pixel = int64_t{blockIdx.x} * kBlock + threadIdx.x;
  if (pixel >= p.num_pixels) return;
  const PixelFeature f = LoadPixelFeature(p.map, pixel, psi2, p.min_norm);
  for (int q = 0; q < num_queries; ++q) {
    p.similarity[int64_t{first + q} * p.num_pixels + pixel] = CosineTo(f, query[q]);
  }
}

}  // namespace

void CudaBackend::Similarity(const SimilarityArgs& args) {
  const Turn turn(*this);
  const int64_t num_pixels = args.map.size / kFeatureSize;
  const int num_queries = static_cast<int>(args.queries.size / kFeatureSize);
  if (!turn || num_pixels == 0 || num_queries == 0) return;
  const dim3 grid(NumBlocks(num_pixels, kBlock), NumBlocks(num_queries, kQueriesAtOnce));
  SimilarityKernel<<<grid, kBlock, 0, stream_>>>(
      {reinterpret_cast<const uint4*>(args.map.data), args.psi.data, args.queries.data, num_pixels,
       num_queries, args.min_norm, args.similarity.data});
  Launched("similarity");
}

namespace {

struct SegmentParams {
  const uint4* map;  // [num_pixels, 32] halves
  const float* psi;
  const float* queries;
  int64_t num_pixels;
  int num_queries, num_positive;
  float min_norm, threshold;
  uint8_t* mask;
  float* similarity;  // or null
  unsigned long long* sums;
};

// All lanes stay to the end, because the ballot and the sum are over whole warps.
__global__ void __launch_bounds__(kBlock) SegmentKernel(SegmentParams p) {
  extern __shared__ float queries[];  // [num_queries, 32]
  __shared__ float psi2[kFeatureSize];
  GateQueries(p.psi, p.queries, p.num_queries, psi2, queries);
  const int64_t pixel = int64_t{blockIdx.x} * kBlock + threadIdx.x;
  bool inside = false;
  float positive = -INFINITY;
  if (pixel < p.num_pixels) {
    const PixelFeature f = LoadPixelFeature(p.map, pixel, psi2, p.min_norm);
    const BestCosines best = BestCosinesTo(f, queries, p.num_queries, p.num_positive);
    positive = best.positive;
    inside = positive > p.threshold && positive > best.negative;
    p.mask[pixel] = inside ? 1 : 0;
    if (p.similarity != nullptr) p.similarity[pixel] = positive;
  }
  const int term = inside ? __float2int_rn(positive * kSimilarityUnit) : 0;
  const unsigned num_inside = __popc(__ballot_sync(~0u, inside));
  const int sum = __reduce_add_sync(~0u, term);  // at most 32 * 2^20
  if (threadIdx.x % 32 == 0 && num_inside > 0) {
    atomicAdd(&p.sums[kNumInside], static_cast<unsigned long long>(num_inside));
    atomicAdd(&p.sums[kSimilaritySum], static_cast<unsigned long long>(static_cast<int64_t>(sum)));
  }
}

}  // namespace

void CudaBackend::SegmentPixels(const SegmentPixelsArgs& args) {
  const Turn turn(*this);
  if (!turn) return;
  Keep(cudaMemsetAsync(args.sums.data, 0, kNumSegmentSums * sizeof(int64_t), stream_),
       "clearing sums");
  const int64_t num_pixels = args.map.size / kFeatureSize;
  if (num_pixels == 0) return;
  const auto num_queries = static_cast<int>(args.queries.size / kFeatureSize);
  const size_t shared = args.queries.size * sizeof(float);
  SegmentKernel<<<NumBlocks(num_pixels, kBlock), kBlock, shared, stream_>>>(
      {reinterpret_cast<const uint4*>(args.map.data), args.psi.data, args.queries.data, num_pixels,
       num_queries, args.num_positive, args.min_norm, args.threshold, args.mask.data,
       args.similarity.size > 0 ? args.similarity.data : nullptr,
       reinterpret_cast<unsigned long long*>(args.sums.data)});
  Launched("segment pixels");
}

namespace {

__global__ void __launch_bounds__(kBlock)
    PackMaskKernel(const uint8_t* mask, int64_t num_pixels, uint32_t* bits) {
  const int64_t pixel = int64_t{blockIdx.x} * kBlock + threadIdx.x;
  const unsigned word = __ballot_sync(~0u, pixel < num_pixels && mask[pixel] != 0);
  if (threadIdx.x % 32 == 0 && pixel < num_pixels) bits[pixel / 32] = word;
}

}  // namespace

void CudaBackend::PackMask(const PackMaskArgs& args) {
  const Turn turn(*this);
  if (!turn || args.mask.size == 0) return;
  PackMaskKernel<<<NumBlocks(args.mask.size, kBlock), kBlock, 0, stream_>>>(
      args.mask.data, args.mask.size, args.bits.data);
  Launched("pack mask");
}

namespace {

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
  GateQueries(p.psi + scale * kFeatureSize, p.queries, p.num_queries, psi2, queries);
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
