#include <cuda_runtime.h>

#include "kernels/cuda/channel.cuh"
#include "kernels/cuda/cuda_backend.h"

// PerceptionLoss (PerceptionLossArgs in kernels/ops/feature.h; METHOD.md section 3, "Perception
// loss"; terms in kernels/math/feature.h). Two launches, ordered by the stream.
//
// PairKernel: a block takes kPixels pixels, one by one: one warp per scale, one lane per channel.
// It goes through the pairs of the pixel; norms and cosines are shuffles over the warp. Each pair
// is listed under both of its pixels, so a pixel's gradient is complete without atomics. Shared
// memory holds the gradients of the scales, which warp 0 adds to pixel_grad; __syncthreads before
// and after. Gradients of psi and losses are summed over the pixels of the block and stored.
//
// SumKernel: one block adds what the blocks have stored; kSumWarps warps share a scale. After
// __syncthreads warp 0 adds over these and the scales, and passes the gradient on to the gate.
// Losses are halved, because each pair is counted twice.
//
// All sums are over pairs, scales, pixels and blocks in fixed orders: the same in every run.

namespace pepeseg {
namespace {

constexpr int kPixels = 4;    // pixels of a block of PairKernel
constexpr int kAtOnce = 4;    // pairs whose features are in flight at once
constexpr int kSumWarps = 3;  // warps a scale in SumKernel

// Arguments, and parts of sums in the backend's temporary memory.
struct Work {
  PerceptionLossArgs args;
  int num_pixels, num_scales;
  float* psi_grad;  // [pixel blocks, scales, 32]
  double* loss;     // [pixel blocks, scales] over ordered pairs
};

Work TakeWork(const PerceptionLossArgs& args, Arena& arena) {
  Work work = {args, static_cast<int>(args.first.size - 1), static_cast<int>(args.scales.size)};
  const int64_t parts = int64_t{NumBlocks(work.num_pixels, kPixels)} * work.num_scales;
  work.psi_grad = arena.Take<float>(parts * kFeatureSize);
  work.loss = arena.Take<double>(parts);
  return work;
}

// One channel of psi at a scale.
__device__ float PsiOf(const Work& work, int scale, int lane) {
  return PsiChannel(work.args.gate, work.args.scales.data[scale], lane);
}

// One pixel at one scale, as a lane holds it.
struct PixelAtScale {
  int scale;
  float psi, unit;        // of the pixel
  float share[2];         // of a similar pair and of a dissimilar one
  float unit_grad, loss;  // sums
};

// Adds the terms and the gradients of kAtOnce pairs from entry e on; entries from `end` on do not
// count.
__device__ void AddPairs(const Work& work, int32_t e, int32_t end, PixelAtScale& pixel) {
  const PerceptionLossArgs& args = work.args;
  const int lane = static_cast<int>(threadIdx.x) % 32;
  float other[kAtOnce];
  PairCues cues[kAtOnce];
#pragma unroll
  for (int k = 0; k < kAtOnce; ++k) {
    const int32_t at = min(e + k, end - 1);
    cues[k] = e + k < end ? args.cues.data[at] >> pixel.scale : 0;
    other[k] = pixel.psi * args.pixel_features.data[args.other.data[at] * kFeatureSize + lane];
  }
#pragma unroll
  for (int k = 0; k < kAtOnce; ++k) {
    const bool similar = (cues[k] & 1u) != 0;
    if (!similar && (cues[k] >> kDissimilarShift & 1u) == 0) continue;  // the same for all lanes
    const float squares = Total(Channel(other[k] * other[k])).v;
    const float along = Total(Channel(pixel.unit * other[k])).v;
    const float inv_norm = 1 / Sqrt(squares + kSquaredNormFloor);
    const float cosine = along * inv_norm, share = pixel.share[similar ? 0 : 1];
    pixel.loss += similar ? share + PositiveTerm(share, cosine) : NegativeTerm(share, cosine, 0.0f);
    const float pull = similar ? PositiveTermVjp(share) : NegativeTermVjp(share, cosine, 0.0f);
    pixel.unit_grad = MulAdd(args.weight * pull * inv_norm, other[k], pixel.unit_grad);
  }
}

// A block's sums at one scale, as a lane holds them.
struct ScaleSums {
  Channel psi, psi_grad;  // psi, and the sum of its gradients
  float loss;
};

// Returns one channel of the gradient of pixel p through one scale, and adds to the sums.
__device__ float PixelGrad(const Work& work, int p, int scale, ScaleSums& sums) {
  const int lane = static_cast<int>(threadIdx.x) % 32;
  const Channel psi = sums.psi;
  const Channel feature(work.args.pixel_features.data[p * kFeatureSize + lane]);
  Channel unit(0);
  GatedUnit(&psi, &feature, 1, &unit);
  const float* share = work.args.share.data + scale;
  PixelAtScale pixel = {scale, psi.v, unit.v, {share[0], share[work.num_scales]}, 0, 0};
  const int32_t end = work.args.first.data[p + 1];
  for (int32_t e = work.args.first.data[p]; e < end; e += kAtOnce) AddPairs(work, e, end, pixel);
  sums.loss += pixel.loss;
  const Channel unit_grad(pixel.unit_grad);
  Channel grad(0);
  GatedUnitVjp(&psi, &feature, 1, &unit_grad, &grad, &sums.psi_grad);
  return grad.v;
}

// The block has as many warps as there are scales. Pixels without pairs are skipped by all of them.
__global__ void __launch_bounds__(kMaxScales * 32) PairKernel(Work work) {
  __shared__ float grads[kMaxScales][kFeatureSize];
  const int scale = static_cast<int>(threadIdx.x) / 32, lane = static_cast<int>(threadIdx.x) % 32;
  ScaleSums sums = {Channel(PsiOf(work, scale, lane)), Channel(0), 0};
  for (int i = 0; i < kPixels; ++i) {
    // The pixels of a block are far apart in the list, because those with many pairs are
    // neighbours.
    const int p = i * static_cast<int>(gridDim.x) + static_cast<int>(blockIdx.x);
    if (p >= work.num_pixels || work.args.first.data[p] == work.args.first.data[p + 1]) continue;
    grads[scale][lane] = PixelGrad(work, p, scale, sums);
    __syncthreads();
    if (scale == 0) {
      float sum = work.args.pixel_grad.data[p * kFeatureSize + lane];
      for (int s = 0; s < work.num_scales; ++s) sum += grads[s][lane];
      work.args.pixel_grad.data[p * kFeatureSize + lane] = sum;
    }
    __syncthreads();
  }
  const int64_t part = int64_t{blockIdx.x} * work.num_scales + scale;
  work.psi_grad[part * kFeatureSize + lane] = sums.psi_grad.v;
  if (lane == 0) work.loss[part] = static_cast<double>(sums.loss);
}

// One block. Warp w has scale w / kSumWarps and every kScalesAtOnce-th after it, and of the blocks
// every kSumWarps-th from w % kSumWarps on.
__global__ void __launch_bounds__(1024) SumKernel(Work work, int num_blocks) {
  constexpr int kScalesAtOnce = 1024 / 32 / kSumWarps;
  __shared__ float psi_grads[kMaxScales][kSumWarps][kFeatureSize];
  __shared__ double losses[kMaxScales][kSumWarps];
  const int warp = static_cast<int>(threadIdx.x) / 32, lane = static_cast<int>(threadIdx.x) % 32;
  const int turn = warp % kSumWarps;
  for (int scale = warp / kSumWarps; scale < work.num_scales; scale += kScalesAtOnce) {
    float psi_grad = 0;
#pragma unroll 8
    for (int block = turn; block < num_blocks; block += kSumWarps) {
      psi_grad += work.psi_grad[(int64_t{block} * work.num_scales + scale) * kFeatureSize + lane];
    }
    double loss = 0;
    for (int block = turn + kSumWarps * lane; block < num_blocks; block += kSumWarps * 32) {
      loss += work.loss[int64_t{block} * work.num_scales + scale];
    }
    for (int offset = 16; offset > 0; offset /= 2) loss += __shfl_xor_sync(~0u, loss, offset);
    psi_grads[scale][turn][lane] = psi_grad;
    if (lane == 0) losses[scale][turn] = loss;
  }
  __syncthreads();
  if (warp != 0) return;
  const DeviceSpan<float> gate_grad = work.args.gate_grad;
  const bool two_layers = HasTwoLayers(gate_grad.size, kFeatureSize);
  float weight_grad = 0, bias_grad = 0;
  double loss = 0;
  for (int scale = 0; scale < work.num_scales; ++scale) {
    float psi_grad = 0;
    for (const auto& of_turn : psi_grads[scale]) psi_grad += of_turn[lane];
    const float grad = GateVjp(PsiOf(work, scale, lane), psi_grad);
    if (two_layers) {
      AddTwoLayerGrad(work.args.gate.data, work.args.scales.data[scale], grad, gate_grad.data);
    }
    weight_grad = MulAdd(work.args.scales.data[scale], grad, weight_grad);
    bias_grad += grad;
    for (const double of_turn : losses[scale]) loss += 0.5 * of_turn;
  }
  if (lane == 0) work.args.loss.data[0] = loss;
  if (two_layers) return;
  gate_grad.data[lane] += weight_grad;
  gate_grad.data[kFeatureSize + lane] += bias_grad;
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
  const int num_blocks = NumBlocks(work.num_pixels, kPixels);
  PairKernel<<<num_blocks, work.num_scales * 32, 0, stream_>>>(work);
  SumKernel<<<1, kSumWarps * 32 * (32 / kSumWarps), 0, stream_>>>(work, num_blocks);
  Launched("perception loss");
}

}  // namespace pepeseg
