#include <cuda_runtime.h>

#include "kernels/cuda/pair_work.cuh"
#include "kernels/math/gate.h"

namespace pepeseg {
namespace {

constexpr int kBlock = 512;
constexpr int kWarps = kBlock / 32;

struct Shared {
  float psi_grad[kWarps][kMaxScales * kFeatureSize];
  double loss[kWarps];
};

// The same order each time; thread 0 gets the sum.
__device__ double BlockSum(double value, Shared& shared) {
  for (int offset = 16; offset > 0; offset /= 2) value += __shfl_xor_sync(~0u, value, offset);
  __syncthreads();
  if (threadIdx.x % 32 == 0) shared.loss[threadIdx.x / 32] = value;
  __syncthreads();
  double sum = 0;
  for (const double of_warp : shared.loss) sum += of_warp;
  return sum;
}

__device__ void SumLosses(const PairWork& work, int num_tiles, int num_pixel_blocks,
                          Shared& shared) {
  double positive = 0, negative = 0, norm = 0;
  for (int i = static_cast<int>(threadIdx.x); i < num_tiles; i += kBlock) {
    positive += work.tile_part[i].positive;
    negative += work.tile_part[i].negative;
  }
  for (int i = static_cast<int>(threadIdx.x); i < num_pixel_blocks; i += kBlock) {
    norm += work.norm_loss[i];
  }
  positive = BlockSum(positive, shared);
  negative = BlockSum(negative, shared);
  norm = BlockSum(norm, shared);
  if (threadIdx.x != 0) return;
  double* sums = work.args.sums.data;
  sums[kPositiveLoss] = positive;
  sums[kNegativeLoss] = negative;
  sums[kNormLoss] = norm;
  sums[kNumPositives] = static_cast<double>(work.counts->positives);
  sums[kNumNegatives] = static_cast<double>(work.counts->negatives);
  sums[kNumNormPixels] = static_cast<double>(work.counts->norm_pixels);
}

// Warps take turns with the blocks of pixels, then threads sum over the warps.
__device__ void SumGate(const PairWork& work, int num_pixel_blocks, Shared& shared) {
  const int warp = static_cast<int>(threadIdx.x) / 32, lane = static_cast<int>(threadIdx.x) % 32;
  const int num_psi = work.num_scales * kFeatureSize;
  float sum[kMaxScales] = {};
  for (int block = warp; block < num_pixel_blocks; block += kWarps) {
#pragma unroll
    for (int scale = 0; scale < kMaxScales; ++scale) {
      if (scale >= work.num_scales) break;
      sum[scale] += work.psi_grad[block * num_psi + scale * kFeatureSize + lane];
    }
  }
#pragma unroll
  for (int scale = 0; scale < kMaxScales; ++scale) {
    shared.psi_grad[warp][scale * kFeatureSize + lane] = sum[scale];
  }
  __syncthreads();
  for (int i = static_cast<int>(threadIdx.x); i < num_psi; i += kBlock) {
    float psi_grad = 0;
    for (const auto& of_warp : shared.psi_grad) psi_grad += of_warp[i];
    shared.psi_grad[0][i] = GateVjp(work.psi[i], psi_grad);  // read by this thread alone
  }
  __syncthreads();
  if (warp != 0) return;
  float weight_grad = 0, bias_grad = 0;
  for (int scale = 0; scale < work.num_scales; ++scale) {
    const float grad = shared.psi_grad[0][scale * kFeatureSize + lane];
    weight_grad = MulAdd(work.args.scales.data[scale], grad, weight_grad);
    bias_grad += grad;
  }
  work.args.gate_grad.data[lane] = weight_grad;
  work.args.gate_grad.data[kFeatureSize + lane] = bias_grad;
}

// One block adds what the tiles and the blocks of pixels have left.
__global__ void __launch_bounds__(kBlock)
    SumKernel(PairWork work, int num_tiles, int num_pixel_blocks) {
  __shared__ Shared shared;
  SumLosses(work, num_tiles, num_pixel_blocks, shared);
  SumGate(work, num_pixel_blocks, shared);
}

}  // namespace

void LaunchPairSums(const PairWork& work, cudaStream_t stream) {
  SumKernel<<<1, kBlock, 0, stream>>>(work, NumPairTiles(work), NumPixelBlocks(work));
}

}  // namespace pepeseg
