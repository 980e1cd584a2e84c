#include <cuda_runtime.h>

#include "kernels/cuda/gate.cuh"
#include "kernels/cuda/pair_work.cuh"

// Last pass of PairLoss: adds the parts that tiles and blocks of pixels have stored, and passes the
// gradient of psi on to the gate. Two blocks, which share nothing: block 0 has the gate, block 1
// the losses. Every sum has a fixed order: a thread (or a warp) adds every k-th part, then shuffles
// or shared memory add over threads, with __syncthreads in between.

namespace pepeseg {
namespace {

constexpr int kBlock = 512;
constexpr int kWarps = kBlock / 32;

// Places in `sums` of the three losses that are added here.
constexpr int kNumLosses = 3;
__constant__ const int kLosses[kNumLosses] = {kPositiveLoss, kNegativeLoss, kNormLoss};

// Shared memory: of SumGate and of SumLosses.
struct Shared {
  float psi_grad[kWarps][kMaxScales * kFeatureSize];
  double loss[kWarps][kNumLosses];
};

// Sums the losses in double and copies the counts. By block 1.
__device__ void SumLosses(const PairWork& work, int num_tiles, int num_pixel_blocks,
                          Shared& shared) {
  double loss[kNumLosses] = {};
  for (int i = static_cast<int>(threadIdx.x); i < num_tiles; i += kBlock) {
    loss[0] += work.tile_part[i].positive;
    loss[1] += work.tile_part[i].negative;
  }
  for (int i = static_cast<int>(threadIdx.x); i < num_pixel_blocks; i += kBlock) {
    loss[2] += work.norm_loss[i];
  }
#pragma unroll
  for (int k = 0; k < kNumLosses; ++k) {
    for (int offset = 16; offset > 0; offset /= 2) {
      loss[k] += __shfl_xor_sync(~0u, loss[k], offset);
    }
    if (threadIdx.x % 32 == 0) shared.loss[threadIdx.x / 32][k] = loss[k];
  }
  __syncthreads();
  double* sums = work.args.sums.data;
  if (threadIdx.x < kNumLosses) {
    double sum = 0;
    for (const auto& of_warp : shared.loss) sum += of_warp[threadIdx.x];
    sums[kLosses[threadIdx.x]] = sum;
  }
  if (threadIdx.x != 0) return;
  sums[kNumPositives] = static_cast<double>(work.counts->positives);
  sums[kNumNegatives] = static_cast<double>(work.counts->negatives);
  sums[kNumNormPixels] = static_cast<double>(work.counts->norm_pixels);
}

// Sums the gradients of psi: each warp adds every kWarps-th block of pixels, then each thread adds
// one (scale, channel) over the warps. One warp then adds the gate's weights and biases over the
// scales. By block 0.
__device__ void SumGate(const PairWork& work, int num_pixel_blocks, Shared& shared) {
  const int warp = static_cast<int>(threadIdx.x) / 32, lane = static_cast<int>(threadIdx.x) % 32;
  const int num_psi = work.num_scales * kFeatureSize;
  float sum[kMaxScales] = {};
#pragma unroll 2
  for (int block = warp; block < num_pixel_blocks; block += kWarps) {
    const float* parts = work.psi_grad + block * num_psi + lane;
#pragma unroll
    for (int scale = 0; scale < kMaxScales; ++scale) {  // all loads in flight at once
      sum[scale] += parts[min(scale, work.num_scales - 1) * kFeatureSize];
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
  const DeviceSpan<float> gate_grad = work.args.gate_grad;
  const bool two_layers = HasTwoLayers(gate_grad.size, kFeatureSize);
  if (two_layers) {  // AddTwoLayerGrad adds to it
    for (int64_t i = threadIdx.x; i < gate_grad.size; i += kBlock) gate_grad.data[i] = 0;
  }
  __syncthreads();
  if (warp != 0) return;
  float weight_grad = 0, bias_grad = 0;
  for (int scale = 0; scale < work.num_scales; ++scale) {
    const float grad = shared.psi_grad[0][scale * kFeatureSize + lane];
    if (two_layers) {
      AddTwoLayerGrad(work.args.gate.data, work.args.scales.data[scale], grad, gate_grad.data);
      continue;
    }
    weight_grad = MulAdd(work.args.scales.data[scale], grad, weight_grad);
    bias_grad += grad;
  }
  if (two_layers) return;
  gate_grad.data[lane] = weight_grad;
  gate_grad.data[kFeatureSize + lane] = bias_grad;
}

__global__ void __launch_bounds__(kBlock)
    SumKernel(PairWork work, int num_tiles, int num_pixel_blocks) {
  __shared__ Shared shared;
  if (blockIdx.x == 0) return SumGate(work, num_pixel_blocks, shared);
  SumLosses(work, num_tiles, num_pixel_blocks, shared);
}

}  // namespace

void LaunchPairSums(const PairWork& work, cudaStream_t stream) {
  SumKernel<<<2, kBlock, 0, stream>>>(work, NumPairTiles(work), NumPixelBlocks(work));
}

}  // namespace pepeseg
