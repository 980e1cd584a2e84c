#include <cuda_runtime.h>

#include "kernels/cuda/channel.cuh"
#include "kernels/cuda/pair_work.cuh"
#include "kernels/math/gate.h"

namespace pepeseg {
namespace {

constexpr int kRows = kPairPad;  // pixels p of a block
constexpr int kColumns = 32;     // pixels q at a time
constexpr int kOwn = 4;          // a thread has kOwn pixels x kOwn channels
constexpr int kChannelGroups = kFeatureSize / kOwn;
constexpr int kBlock = kRows / kOwn * kChannelGroups;

struct Batch {
  alignas(16) float cosine_grad[kColumns][kRows];    // d loss / d cosine
  alignas(16) float column[kColumns][kFeatureSize];  // F / |psi F|
};

// What turns a word of the plan into a gradient, of one scale and one pixel p.
struct RowGrad {
  int pull_bit, push_bit;
  float pull, push;   // -1 / positives, 1 / negatives
  float base, slope;  // of the weight, with that of p
};

__device__ float Inverse(unsigned long long count) {
  return count == 0 ? 0.0f : static_cast<float>(1 / static_cast<double>(count));
}

__device__ RowGrad RowGradOf(const PairWork& work, int scale, int p) {
  const PairWeights weights = *work.weights;
  const float weight = p < work.num_pixels ? work.args.pixel_weight.data[p] : 0.0f;
  return {scale,
          kPushShift + scale,
          PositiveTermVjp(Inverse(work.counts->positives)),
          Inverse(work.counts->negatives),
          weights.base,
          weights.slope * weight};
}

__device__ void LoadColumns(const PairWork& work, int scale, int first, Batch& batch) {
  constexpr int kWords = kFeatureSize / 4;
  const auto* features = reinterpret_cast<const float4*>(work.args.pixel_features.data);
#pragma unroll
  for (int i = static_cast<int>(threadIdx.x); i < kColumns * kWords; i += kBlock) {
    const int q = first + i / kWords;
    float4 f = {0, 0, 0, 0};
    if (q < work.num_pixels) f = features[q * kWords + i % kWords];
    const float inv_norm = work.inv_norm[scale * work.padded + q];
    *reinterpret_cast<float4*>(&batch.column[i / kWords][i % kWords * 4]) = {
        inv_norm * f.x, inv_norm * f.y, inv_norm * f.z, inv_norm * f.w};
  }
}

// The plan is symmetric: rows q are read, pixels p side by side.
__device__ void LoadCosineGrads(const PairWork& work, const RowGrad& grad, int first, int p,
                                Batch& batch) {
  const int last = work.num_pixels - 1, part = static_cast<int>(threadIdx.x) / kRows;
#pragma unroll
  for (int i = part; i < kColumns; i += kBlock / kRows) {
    const int q = first + i;
    const PairBits bits = work.plan[int64_t{q} * work.padded + p];
    const float weight = MulAdd(grad.slope, work.args.pixel_weight.data[min(q, last)], grad.base);
    const float push = (bits >> grad.push_bit & 1u) != 0 ? grad.push : 0.0f;
    batch.cosine_grad[i][p % kRows] =
        weight * ((bits >> grad.pull_bit & 1u) != 0 ? grad.pull : push);
  }
}

__device__ void AddBatch(const Batch& batch, int row, int channel, float (&sum)[kOwn][kOwn]) {
#pragma unroll
  for (int q = 0; q < kColumns; ++q) {
    const float4 a = *reinterpret_cast<const float4*>(&batch.cosine_grad[q][row]);
    const float4 b = *reinterpret_cast<const float4*>(&batch.column[q][channel]);
    const float grad[kOwn] = {a.x, a.y, a.z, a.w}, value[kOwn] = {b.x, b.y, b.z, b.w};
#pragma unroll
    for (int i = 0; i < kOwn; ++i) {
#pragma unroll
      for (int k = 0; k < kOwn; ++k) sum[i][k] = MulAdd(grad[i], value[k], sum[i][k]);
    }
  }
}

// sum over q of (d loss / d cosine) F_q / |psi F_q|, for kRows pixels p at one scale, over one part
// of the q.
__global__ void __launch_bounds__(kBlock) UnitGradientKernel(PairWork work) {
  __shared__ Batch batch;
  const int first_row = static_cast<int>(blockIdx.x) * kRows;
  const int scale = static_cast<int>(blockIdx.y), split = static_cast<int>(blockIdx.z);
  const int num_batches = work.padded / kColumns;
  const int own = first_row + static_cast<int>(threadIdx.x) % kRows;
  const int row = static_cast<int>(threadIdx.x) / kChannelGroups * kOwn;
  const int channel = static_cast<int>(threadIdx.x) % kChannelGroups * kOwn;
  const RowGrad grad = RowGradOf(work, scale, own);
  float sum[kOwn][kOwn] = {};
  const int end = num_batches * (split + 1) / kPairSplits;
  for (int i = num_batches * split / kPairSplits; i < end; ++i) {
    __syncthreads();
    LoadColumns(work, scale, i * kColumns, batch);
    LoadCosineGrads(work, grad, i * kColumns, own, batch);
    __syncthreads();
    AddBatch(batch, row, channel, sum);
  }
  const int64_t place = (int64_t{split} * work.num_scales + scale) * work.padded + first_row + row;
#pragma unroll
  for (int i = 0; i < kOwn; ++i) {
    *reinterpret_cast<float4*>(&work.unit_grad[(place + i) * kFeatureSize + channel]) = {
        sum[i][0], sum[i][1], sum[i][2], sum[i][3]};
  }
}

// A pixel's gradient through its gated and normalised features.
constexpr int kPixelBlock = 32 * kPixelWarps;
struct PixelShared {
  float psi_grad[kPixelWarps][kMaxScales * kFeatureSize];
  double norm_loss[kPixelWarps];
};

__device__ Channel BackwardPixel(const PairWork& work, int p, const Channel& feature,
                                 float* psi_grads) {
  const int lane = static_cast<int>(threadIdx.x) % 32;
  Channel grad(0);
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

// A warp a pixel.
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

}  // namespace

void LaunchUnitGradients(const PairWork& work, cudaStream_t stream) {
  const dim3 grid(work.padded / kRows, work.num_scales, kPairSplits);
  UnitGradientKernel<<<grid, kBlock, 0, stream>>>(work);
}

void LaunchPixelGradients(const PairWork& work, cudaStream_t stream) {
  PixelGradientKernel<<<NumPixelBlocks(work), kPixelBlock, 0, stream>>>(work);
}

}  // namespace pepeseg
