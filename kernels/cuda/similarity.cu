#include <cuda_fp16.h>
#include <cuda_runtime.h>

#include "kernels/cuda/cuda_backend.h"
#include "kernels/cuda/launch.h"

namespace pepeseg {
namespace {

constexpr int kBlock = 256;
constexpr int kQueriesAtOnce = 32;

struct SimilarityParams {
  const uint4* map;  // [num_pixels, 32] halves: four words of eight
  const float* psi;
  const float* queries;
  int64_t num_pixels;
  int num_queries;
  float min_norm;
  float* similarity;
};

// A thread a pixel; the block normalises the gated queries first. cos = sum_k psi_k^2 f_k q_k over
// the norms of psi f and psi q.
__global__ void __launch_bounds__(kBlock) SimilarityKernel(SimilarityParams p) {
  __shared__ float psi2[kFeatureSize];
  __shared__ float query[kQueriesAtOnce][kFeatureSize];  // psi^2 q / |psi q|
  const int first = static_cast<int>(blockIdx.y) * kQueriesAtOnce;
  const int num_queries = min(kQueriesAtOnce, p.num_queries - first);
  const int lane = static_cast<int>(threadIdx.x) % 32;
  const float gate = p.psi[lane];
  if (threadIdx.x < 32) psi2[lane] = gate * gate;
  for (int q = static_cast<int>(threadIdx.x) / 32; q < num_queries; q += kBlock / 32) {
    const float gated = gate * p.queries[int64_t{first + q} * kFeatureSize + lane];
    float norm2 = gated * gated;
    for (int offset = 16; offset > 0; offset /= 2) norm2 += __shfl_xor_sync(~0u, norm2, offset);
    query[q][lane] = norm2 > 0 ? gate * gated * rsqrtf(norm2) : 0.0f;
  }
  __syncthreads();
  const int64_t pixel = int64_t{blockIdx.x} * kBlock + threadIdx.x;
  if (pixel >= p.num_pixels) return;
  float f[kFeatureSize], squares = 0, norm2 = 0;
#pragma unroll
  for (int word = 0; word < kFeatureSize / 8; ++word) {
    const uint4 bits = p.map[pixel * (kFeatureSize / 8) + word];
    const uint32_t pairs[4] = {bits.x, bits.y, bits.z, bits.w};
#pragma unroll
    for (int k = 0; k < 4; ++k) {
      const float2 two = __half22float2(reinterpret_cast<const __half2&>(pairs[k]));
      f[8 * word + 2 * k] = two.x;
      f[8 * word + 2 * k + 1] = two.y;
    }
  }
#pragma unroll
  for (int k = 0; k < kFeatureSize; ++k) {
    squares += f[k] * f[k];
    norm2 += psi2[k] * f[k] * f[k];
  }
  const bool counts = norm2 > 0 && squares >= p.min_norm * p.min_norm;
  const float inv_norm = counts ? rsqrtf(norm2) : 0.0f;
  for (int q = 0; q < num_queries; ++q) {
    float dot = 0;
#pragma unroll
    for (int k = 0; k < kFeatureSize; ++k) dot += f[k] * query[q][k];
    p.similarity[int64_t{first + q} * p.num_pixels + pixel] = dot * inv_norm;
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

}  // namespace pepeseg
