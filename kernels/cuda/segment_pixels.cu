#include <cuda_runtime.h>

#include "kernels/cuda/cuda_backend.h"
#include "kernels/cuda/launch.h"
#include "kernels/cuda/pixel_feature.cuh"

// SegmentPixels (SegmentPixelsArgs in kernels/ops/feature.h; METHOD.md section 4): the mask of a
// query. A thread has a pixel. The block first gates all queries, at most 256, into 32 KiB of
// dynamic shared memory (GateQueries, which ends with __syncthreads). Counts and similarities are
// added over the warp and then by one atomic a warp; similarities are rounded to integers first, so
// the sums are exact in any order and the same in every run.

namespace pepeseg {
namespace {

constexpr int kBlock = 256;

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
  GateQueries<kBlock>(p.psi, p.queries, p.num_queries, psi2, queries);
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

}  // namespace pepeseg
