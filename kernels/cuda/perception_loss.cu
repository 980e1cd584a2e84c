#include <cuda_runtime.h>

#include "kernels/cuda/arena.h"
#include "kernels/cuda/channel.cuh"
#include "kernels/cuda/cuda_backend.h"
#include "kernels/cuda/launch.h"
#include "kernels/math/gate.h"

namespace pepeseg {
namespace {

constexpr int kWarps = 8;
constexpr int kBlock = 32 * kWarps;
constexpr int kSumBlock = 512;

struct Work {
  PerceptionLossArgs args;
  int num_pixels, num_scales;
  float* inv_norm;  // [S, scales] 1 / |psi * F|; only of pixels with a pair
  float* psi_grad;  // [pixel blocks, scales, 32]
  double* loss;     // [pixel blocks] of ordered pairs
};

Work TakeWork(const PerceptionLossArgs& args, Arena& arena) {
  Work work = {args, static_cast<int>(args.first.size - 1), static_cast<int>(args.scales.size)};
  const int64_t blocks = NumBlocks(work.num_pixels, kWarps), scales = work.num_scales;
  work.inv_norm = arena.Take<float>(work.num_pixels * scales);
  work.psi_grad = arena.Take<float>(blocks * scales * kFeatureSize);
  work.loss = arena.Take<double>(blocks);
  return work;
}

__device__ float PsiOf(const Work& work, int scale, int lane) {
  const float* gate = work.args.gate.data;
  return Gate(gate[lane], gate[kFeatureSize + lane], work.args.scales.data[scale]);
}

// A warp a pixel.
__global__ void __launch_bounds__(kBlock) NormKernel(Work work) {
  const int p = static_cast<int>(blockIdx.x * kWarps + threadIdx.x / 32);
  const int lane = static_cast<int>(threadIdx.x) % 32;
  if (p >= work.num_pixels || work.args.first.data[p] == work.args.first.data[p + 1]) return;
  const Channel feature(work.args.pixel_features.data[p * kFeatureSize + lane]);
  for (int scale = 0; scale < work.num_scales; ++scale) {
    const Channel psi(PsiOf(work, scale, lane));
    Channel unit(0);
    const Channel inv_norm = GatedUnit(&psi, &feature, 1, &unit);
    if (lane == 0) work.inv_norm[p * work.num_scales + scale] = inv_norm.v;
  }
}

// The pairs of one pixel at one scale: their terms' sum, and the gradient of the pixel's unit.
__device__ float AddPairs(const Work& work, int p, int scale, float psi, float unit,
                          float& unit_grad) {
  const PerceptionLossArgs& args = work.args;
  const int lane = static_cast<int>(threadIdx.x) % 32;
  const float similar_share = args.share.data[scale];
  const float dissimilar_share = args.share.data[work.num_scales + scale];
  float loss = 0;
  for (int32_t e = args.first.data[p]; e < args.first.data[p + 1]; ++e) {
    const PairCues cues = args.cues.data[e];
    const bool similar = (cues >> scale & 1u) != 0;
    if (!similar && (cues >> (kDissimilarShift + scale) & 1u) == 0) continue;
    const int q = args.other.data[e];
    const float other = psi * args.pixel_features.data[q * kFeatureSize + lane] *
                        work.inv_norm[q * work.num_scales + scale];
    const float cosine = Total(Channel(unit * other)).v;
    const float share = similar ? similar_share : dissimilar_share;
    loss += similar ? share + PositiveTerm(share, cosine) : NegativeTerm(share, cosine);
    const float pull = similar ? PositiveTermVjp(share) : NegativeTermVjp(share, cosine);
    unit_grad = MulAdd(args.weight * pull, other, unit_grad);
  }
  return loss;
}

struct Shared {
  float psi_grad[kWarps][kMaxScales * kFeatureSize];
  double loss[kWarps];
};

// A warp a pixel; what the block adds to the sums is left in `shared`.
__device__ void AddPixel(const Work& work, int p, int warp, int lane, Shared& shared) {
  const bool has_pair = p < work.num_pixels && work.args.first.data[p] < work.args.first.data[p + 1];
  const int64_t at = has_pair ? int64_t{p} * kFeatureSize + lane : lane;
  const Channel feature(work.args.pixel_features.data[at]);
  Channel grad(0);
  double loss = 0;
  for (int scale = 0; scale < work.num_scales; ++scale) {
    Channel psi_grad(0);
    if (has_pair) {
      const Channel psi(PsiOf(work, scale, lane));
      const float unit = psi.v * feature.v * work.inv_norm[p * work.num_scales + scale];
      Channel unit_grad(0);
      loss += static_cast<double>(AddPairs(work, p, scale, psi.v, unit, unit_grad.v));
      GatedUnitVjp(&psi, &feature, 1, &unit_grad, &grad, &psi_grad);
    }
    shared.psi_grad[warp][scale * kFeatureSize + lane] = psi_grad.v;
  }
  if (has_pair) work.args.pixel_grad.data[at] += grad.v;
  if (lane == 0) shared.loss[warp] = loss;
}

__global__ void __launch_bounds__(kBlock) PairKernel(Work work) {
  __shared__ Shared shared;
  const int warp = static_cast<int>(threadIdx.x) / 32, lane = static_cast<int>(threadIdx.x) % 32;
  AddPixel(work, static_cast<int>(blockIdx.x) * kWarps + warp, warp, lane, shared);
  __syncthreads();
  const int num_psi = work.num_scales * kFeatureSize;
  for (int i = static_cast<int>(threadIdx.x); i < num_psi; i += kBlock) {
    float sum = 0;
    for (const auto& of_warp : shared.psi_grad) sum += of_warp[i];
    work.psi_grad[blockIdx.x * num_psi + i] = sum;
  }
  if (threadIdx.x != 0) return;
  double sum = 0;
  for (const double of_warp : shared.loss) sum += of_warp;
  work.loss[blockIdx.x] = sum;
}

// One block, in a fixed order: a warp a scale.
__global__ void __launch_bounds__(kSumBlock) SumKernel(Work work, int num_blocks) {
  __shared__ float bias_grads[kMaxScales][kFeatureSize];
  static_assert(kSumBlock == kMaxScales * kFeatureSize);
  const int scale = static_cast<int>(threadIdx.x) / 32, lane = static_cast<int>(threadIdx.x) % 32;
  if (scale < work.num_scales) {
    float psi_grad = 0;
#pragma unroll 8
    for (int block = 0; block < num_blocks; ++block) {
      psi_grad += work.psi_grad[(block * work.num_scales + scale) * kFeatureSize + lane];
    }
    bias_grads[scale][lane] = GateVjp(PsiOf(work, scale, lane), psi_grad);
  }
  __syncthreads();
  if (scale != 0) return;
  float* gate_grad = work.args.gate_grad.data;
  for (int s = 0; s < work.num_scales; ++s) {
    gate_grad[lane] += work.args.scales.data[s] * bias_grads[s][lane];
    gate_grad[kFeatureSize + lane] += bias_grads[s][lane];
  }
  double loss = 0;
  for (int block = lane; block < num_blocks; block += 32) loss += 0.5 * work.loss[block];
  for (int offset = 16; offset > 0; offset /= 2) loss += __shfl_xor_sync(~0u, loss, offset);
  if (lane == 0) work.args.loss.data[0] = loss;
}

}  // namespace

void CudaBackend::PerceptionLoss(const PerceptionLossArgs& args) {
  const Turn turn(*this);
  if (!turn || args.first.size <= 1) return;
  Arena sizes;
  TakeWork(args, sizes);
  Arena arena(Temporary(sizes.num_bytes()));
  const Work work = TakeWork(args, arena);
  if (!error_.empty()) return;
  const int num_blocks = NumBlocks(work.num_pixels, kWarps);
  NormKernel<<<num_blocks, kBlock, 0, stream_>>>(work);
  PairKernel<<<num_blocks, kBlock, 0, stream_>>>(work);
  SumKernel<<<1, kSumBlock, 0, stream_>>>(work, num_blocks);
  Launched("perception loss");
}

}  // namespace pepeseg
