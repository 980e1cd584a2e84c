#include <cuda_runtime.h>

#include "kernels/cuda/cuda_backend.h"
#include "kernels/cuda/launch.h"
#include "kernels/cuda/pixel_feature.cuh"

// Similarity (SimilarityArgs in kernels/ops/feature.h; METHOD.md section 4): the cosine of each
// pixel to each query. A thread has a pixel, a block 256 of them against up to 32 queries
// (blockIdx.y). The block first gates its queries into shared memory, a warp a query, and meets at
// __syncthreads; after it threads share nothing. Formulas are in pixel_feature.cuh.

namespace pepeseg {
namespace {

constexpr int kBlock = 256;
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

}  // namespace pepeseg
