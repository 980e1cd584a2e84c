#include <cuda_runtime.h>

#include "kernels/cuda/channel.cuh"
#include "kernels/cuda/cuda_backend.h"
#include "kernels/cuda/pair_work.cuh"

// PairLoss (PairLossArgs in kernels/ops/feature.h; METHOD.md section 3, "Contrastive loss" and
// "Norms"): sizes the working memory and launches the passes in their order. The host waits for
// nothing, so the op can be recorded. Contracts that the passes share are in pair_work.cuh. The
// last two passes are in this file.
//
// PixelGradientKernel: the gradient of each pixel's feature and of the gate, through the gated and
// normalised features at all scales (GatedUnitVjp of kernels/math/feature.h), and the norm term.
// One warp per pixel, one lane per channel; a block is kPixelWarps warps. Norms are shuffles over
// the warp. Shared memory holds the gradients of psi and the norm term of each warp; after one
// __syncthreads the block adds them over its warps and stores them for SumKernel. All sums have a
// fixed order: over the parts of pair_gradients.cu, the scales, the warps.
//
// SumKernel: adds the parts that tiles and blocks of pixels have stored, and passes the gradient of
// psi on to the gate. Two blocks, which share nothing: block 0 has the gate, block 1 the losses.
// Every sum has a fixed order: a thread (or a warp) adds every k-th part, then shuffles or shared
// memory add over threads, with __syncthreads in between.

namespace pepeseg {
namespace {

constexpr int kPixelBlock = 32 * kPixelWarps;
struct PixelShared {
  float psi_grad[kPixelWarps][kMaxScales * kFeatureSize];
  double norm_loss[kPixelWarps];
};

// Returns one channel of the gradient of pixel p through all scales, and writes those of psi to
// psi_grads[scales, 32].
__device__ Channel BackwardPixel(const PairWork& work, int p, const Channel& feature,
                                 float* psi_grads) {
  const int lane = static_cast<int>(threadIdx.x) % 32;
  Channel grad(0);
#pragma unroll 2
  for (int scale = 0; scale < work.num_scales; ++scale) {
    float sum = 0;
#pragma unroll
    for (int split = 0; split < kPairSplits; ++split) {
      const int64_t row = (int64_t{split} * work.num_scales + scale) * work.padded + p;
      sum += work.unit_grad[row * kFeatureSize + lane];
    }
    const Channel psi(work.psi[scale * kFeatureSize + lane]);
    const Channel unit_grad = psi * Channel(sum);
    Channel psi_grad(0);
    GatedUnitVjp(&psi, &feature, 1, &unit_grad, &grad, &psi_grad);
    psi_grads[scale * kFeatureSize + lane] = psi_grad.v;
  }
  return grad;
}

// Warps of the padding take part in the sums with zeros.
__global__ void __launch_bounds__(kPixelBlock) PixelGradientKernel(PairWork work) {
  __shared__ PixelShared shared;
  const int warp = static_cast<int>(threadIdx.x) / 32, lane = static_cast<int>(threadIdx.x) % 32;
  const int p = static_cast<int>(blockIdx.x) * kPixelWarps + warp;
  const bool is_pixel = p < work.num_pixels;  // a row of padding has no gradient
  const int64_t i = int64_t{p} * kFeatureSize + lane;
  const Channel feature(is_pixel ? work.args.pixel_features.data[i] : 0.0f);
  Channel grad = BackwardPixel(work, p, feature, shared.psi_grad[warp]);
  float norm_loss = 0;
  if (is_pixel && work.args.pixel_alpha.data[p] > work.args.min_norm_alpha) {
    norm_loss = NormTerm(&feature, 1).v;
    const Channel pull = NormTermVjp(&feature, 1, Channel(Inverse(work.counts->norm_pixels)));
    grad = MulAdd(pull, feature, grad);
  }
  if (is_pixel) work.args.pixel_grad.data[i] = grad.v;
  if (lane == 0) shared.norm_loss[warp] = static_cast<double>(norm_loss);
  __syncthreads();
  const int num_psi = work.num_scales * kFeatureSize;
  for (int at = static_cast<int>(threadIdx.x); at < num_psi; at += kPixelBlock) {
    float sum = 0;
    for (const auto& of_warp : shared.psi_grad) sum += of_warp[at];
    work.psi_grad[blockIdx.x * num_psi + at] = sum;
  }
  if (threadIdx.x != 0) return;
  double sum = 0;
  for (const double of_warp : shared.norm_loss) sum += of_warp;
  work.norm_loss[blockIdx.x] = sum;
}

void LaunchPixelGradients(const PairWork& work, cudaStream_t stream) {
  PixelGradientKernel<<<NumPixelBlocks(work), kPixelBlock, 0, stream>>>(work);
}

constexpr int kSumBlock = 512;
constexpr int kSumWarps = kSumBlock / 32;

// Places in `sums` of the three losses that are added here.
constexpr int kNumLosses = 3;
__constant__ const int kLosses[kNumLosses] = {kPositiveLoss, kNegativeLoss, kNormLoss};

// SumShared memory: of SumGate and of SumLosses.
struct SumShared {
  float psi_grad[kSumWarps][kMaxScales * kFeatureSize];
  double loss[kSumWarps][kNumLosses];
};

// Sums the losses in double and copies the counts. By block 1.
__device__ void SumLosses(const PairWork& work, int num_tiles, int num_pixel_blocks,
                          SumShared& shared) {
  double loss[kNumLosses] = {};
  for (int i = static_cast<int>(threadIdx.x); i < num_tiles; i += kSumBlock) {
    loss[0] += work.tile_part[i].positive;
    loss[1] += work.tile_part[i].negative;
  }
  for (int i = static_cast<int>(threadIdx.x); i < num_pixel_blocks; i += kSumBlock) {
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

// Sums the gradients of psi: each warp adds every kSumWarps-th block of pixels, then each thread
// adds one (scale, channel) over the warps. One warp then adds the gate's weights and biases over
// the scales. By block 0.
__device__ void SumGate(const PairWork& work, int num_pixel_blocks, SumShared& shared) {
  const int warp = static_cast<int>(threadIdx.x) / 32, lane = static_cast<int>(threadIdx.x) % 32;
  const int num_psi = work.num_scales * kFeatureSize;
  float sum[kMaxScales] = {};
#pragma unroll 2
  for (int block = warp; block < num_pixel_blocks; block += kSumWarps) {
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
  for (int i = static_cast<int>(threadIdx.x); i < num_psi; i += kSumBlock) {
    float psi_grad = 0;
    for (const auto& of_warp : shared.psi_grad) psi_grad += of_warp[i];
    shared.psi_grad[0][i] = GateVjp(work.psi[i], psi_grad);  // read by this thread alone
  }
  const DeviceSpan<float> gate_grad = work.args.gate_grad;
  const bool two_layers = HasTwoLayers(gate_grad.size, kFeatureSize);
  if (two_layers) {  // AddTwoLayerGrad adds to it
    for (int64_t i = threadIdx.x; i < gate_grad.size; i += kSumBlock) gate_grad.data[i] = 0;
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

__global__ void __launch_bounds__(kSumBlock)
    SumKernel(PairWork work, int num_tiles, int num_pixel_blocks) {
  __shared__ SumShared shared;
  if (blockIdx.x == 0) return SumGate(work, num_pixel_blocks, shared);
  SumLosses(work, num_tiles, num_pixel_blocks, shared);
}

void LaunchPairSums(const PairWork& work, cudaStream_t stream) {
  SumKernel<<<2, kSumBlock, 0, stream>>>(work, NumPairTiles(work), NumPixelBlocks(work));
}

// Lays the arrays out in the arena (see Arena). plan has padded^2 words: memory grows with S^2.
PairWork TakePairWork(const PairLossArgs& args, Arena& arena) {
  PairWork work = {};
  work.args = args;
  work.num_pixels = static_cast<int>(args.pixel_weight.size);
  work.num_scales = static_cast<int>(args.scales.size);
  work.padded = (work.num_pixels + kPairPad - 1) / kPairPad * kPairPad;
  const int64_t padded = work.padded, scales = work.num_scales, cells = args.num_cells;
  work.counts = arena.Take<PairCounts>(1);
  work.weights = arena.Take<PairWeights>(1);
  work.psi = arena.Take<float>(scales * kFeatureSize);
  work.inv_norm = arena.Take<float>(scales * padded);
  work.plan = arena.Take<PairBits>(padded * padded);
  work.tile_part = arena.Take<PairLossPart>(NumPairTiles(work));
  work.unit_grad = arena.Take<float>(kPairSplits * scales * padded * kFeatureSize);
  work.psi_grad = arena.Take<float>(NumPixelBlocks(work) * scales * kFeatureSize);
  work.norm_loss = arena.Take<double>(NumPixelBlocks(work));
  work.agrees = arena.Take<uint32_t>(cells * cells);
  return work;
}

}  // namespace

// Makes two passes over pairs. The first (pair_tiles.cu) computes the cosines of a tile of pairs at
// all scales in registers, decides with them which pairs count, and stores a word of bits for each
// pair. The second (pair_gradients.cu) multiplies those bits with the features. The means need the
// numbers of positives and negatives, which are known between the two; a single pass would have to
// keep the gradients of both apart.
void CudaBackend::PairLoss(const PairLossArgs& args) {
  const Turn turn(*this);
  if (!turn) return;
  if (args.scales.size < 1 || args.scales.size > kMaxScales || args.pixel_weight.size >= 1 << 16) {
    return Fail({"PairLoss: " + std::to_string(args.scales.size) + " scales and " +
                 std::to_string(args.pixel_weight.size) + " pixels; the limits are 1 to " +
                 std::to_string(kMaxScales) + " scales and 65535 pixels"});
  }
  Arena sizes;
  TakePairWork(args, sizes);
  Arena arena(Temporary(sizes.num_bytes()));
  if (!error_.empty()) return;
  const PairWork work = TakePairWork(args, arena);
  Zero(work.counts, sizeof(PairCounts));
  LaunchPairPlan(work, stream_);
  Launched("pair plan");
  if (work.num_pixels > 0) {
    LaunchPairTiles(work, stream_);
    Launched("pair tiles");
    LaunchUnitGradients(work, stream_);
    Launched("unit gradients");
    LaunchPixelGradients(work, stream_);
    Launched("pixel gradients");
  }
  LaunchPairSums(work, stream_);
  Launched("pair sums");
}

}  // namespace pepeseg
