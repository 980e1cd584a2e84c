#pragma once

#include <cuda_fp16.h>
#include <cuda_runtime.h>

#include <cstdint>

#include "kernels/ops/render.h"

// Cosines of the pixels of a cached feature map with queries (METHOD.md section 4), shared by
// similarity.cu, segment_pixels.cu and level_overlaps.cu. A thread has a pixel, whose 32 channels
// are in registers; the block has the gated queries in shared memory:
//   cos(psi f, psi q) = sum_k f_k (psi_k^2 q_k / |psi q|) / |psi f|.
// Channels are summed by one thread in their order: the same in every run.

namespace pepeseg {

// Feature f of a pixel.
struct PixelFeature {
  float value[kFeatureSize];
  float inv_norm;  // 1 / |psi f|; 0 where |f| < min_norm, or where psi f is 0
};

// Loads a pixel. map: [num_pixels, 32] halves, four words of eight. psi2: [32] psi^2.
__device__ inline PixelFeature LoadPixelFeature(const uint4* map, int64_t pixel, const float* psi2,
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
__device__ inline float CosineTo(const PixelFeature& f, const float* gated_query) {
  float dot = 0;
#pragma unroll
  for (int k = 0; k < kFeatureSize; ++k) dot += f.value[k] * gated_query[k];
  return dot * f.inv_norm;
}

// Returns one channel of psi^2 q / |psi q|, or 0 for psi q = 0. Called by a whole warp, a channel a
// lane.
__device__ inline float GateQuery(float psi, float query) {
  const float gated = psi * query;
  float norm2 = gated * gated;
  for (int offset = 16; offset > 0; offset /= 2) norm2 += __shfl_xor_sync(~0u, norm2, offset);
  return norm2 > 0 ? psi * gated * rsqrtf(norm2) : 0.0f;
}

// Writes psi^2 [32] and the gated queries [num_queries, 32] to shared memory. Called by all kBlock
// threads of a block; they may read both when it returns, as it ends with __syncthreads.
template <int kBlock>
__device__ inline void GateQueries(const float* psi_of, const float* queries, int num_queries,
                                   float* psi2, float* gated) {
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
__device__ inline BestCosines BestCosinesTo(const PixelFeature& f, const float* gated,
                                            int num_queries, int num_positive) {
  BestCosines found;
  for (int q = 0; q < num_queries; ++q) {
    float& best = q < num_positive ? found.positive : found.negative;
    best = fmaxf(best, CosineTo(f, gated + q * kFeatureSize));
  }
  return found;
}

}  // namespace pepeseg
