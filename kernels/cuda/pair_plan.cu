#include <cuda_runtime.h>

#include "kernels/cuda/channel.cuh"
#include "kernels/cuda/launch.h"
#include "kernels/cuda/pair_work.cuh"
#include "kernels/cuda/running_sum.cuh"
#include "kernels/math/gate.h"

namespace pepeseg {
namespace {

constexpr int kBlock = 256;
constexpr int kWarps = kBlock / 32;

// The two smallest and the two largest of some numbers, the first the more extreme.
struct Extremes {
  float low[2], high[2];
};
__device__ Extremes Merge(const Extremes& a, const Extremes& b) {
  return {{min(a.low[0], b.low[0]), min(max(a.low[0], b.low[0]), min(a.low[1], b.low[1]))},
          {max(a.high[0], b.high[0]), max(min(a.high[0], b.high[0]), max(a.high[1], b.high[1]))}};
}
__device__ Extremes MergeOverWarp(Extremes own) {
  for (int offset = 16; offset > 0; offset /= 2) {
    Extremes other;
    for (int k = 0; k < 2; ++k) {
      other.low[k] = __shfl_xor_sync(~0u, own.low[k], offset);
      other.high[k] = __shfl_xor_sync(~0u, own.high[k], offset);
    }
    own = Merge(own, other);
  }
  return own;
}

__device__ PairWeights ScaleWeights(const Extremes& of_all, int num_pixels) {
  if (num_pixels < 2) return {1, 0};
  const double low = static_cast<double>(of_all.low[0]) * static_cast<double>(of_all.low[1]);
  const double high = static_cast<double>(of_all.high[0]) * static_cast<double>(of_all.high[1]);
  constexpr double kRange = 9;  // to [1, 10]
  if (high - low <= 1e-6 * high) return {1, 0};
  return {static_cast<float>(1 - kRange * low / (high - low)),
          static_cast<float>(kRange / (high - low))};
}

__device__ float PsiOf(const PairWork& work, int scale, int channel) {
  const float* gate = work.args.gate.data;
  return Gate(gate[channel], gate[kFeatureSize + channel], work.args.scales.data[scale]);
}

// One block finds psi, how the weights are scaled, and how many pixels count for the norm.
__device__ void SurveyPixels(const PairWork& work) {
  for (int i = static_cast<int>(threadIdx.x); i < work.num_scales * kFeatureSize; i += kBlock) {
    work.psi[i] = PsiOf(work, i / kFeatureSize, i % kFeatureSize);
  }
  constexpr float kNone = 3e38f;
  __shared__ Extremes of_warp[kWarps];
  Extremes own = {{kNone, kNone}, {-kNone, -kNone}};
  int num_norm_pixels = 0;
  for (int base = 0; base < work.num_pixels; base += kBlock) {
    const int p = base + static_cast<int>(threadIdx.x);
    const bool is_pixel = p < work.num_pixels;
    if (is_pixel) {
      const float weight = work.args.pixel_weight.data[p];
      own = Merge(own, {{weight, kNone}, {weight, -kNone}});
    }
    num_norm_pixels += __syncthreads_count(
        static_cast<int>(is_pixel && work.args.pixel_alpha.data[p] > work.args.min_norm_alpha));
  }
  own = MergeOverWarp(own);
  if (threadIdx.x % 32 == 0) of_warp[threadIdx.x / 32] = own;
  __syncthreads();
  if (threadIdx.x != 0) return;
  for (int warp = 1; warp < kWarps; ++warp) own = Merge(own, of_warp[warp]);
  *work.weights = ScaleWeights(own, work.num_pixels);
  work.counts->norm_pixels = static_cast<unsigned long long>(num_norm_pixels);
}

// A warp a pixel; the last block does the survey.
__global__ void __launch_bounds__(kBlock) GateKernel(PairWork work) {
  if (blockIdx.x + 1 == gridDim.x) return SurveyPixels(work);
  const int p = static_cast<int>(blockIdx.x * kWarps + threadIdx.x / 32);
  const int lane = static_cast<int>(threadIdx.x) % 32;
  if (p >= work.padded) return;
  const bool is_pixel = p < work.num_pixels;
  const Channel feature(is_pixel ? work.args.pixel_features.data[p * kFeatureSize + lane] : 0.0f);
  for (int scale = 0; scale < work.num_scales; ++scale) {
    const Channel psi(PsiOf(work, scale, lane));
    Channel unit(0);
    const Channel inv_norm = GatedUnit(&psi, &feature, 1, &unit);
    if (lane == 0) work.inv_norm[scale * work.padded + p] = is_pixel ? inv_norm.v : 0.0f;
  }
  if (lane == 0 && is_pixel) atomicAdd(&work.patch_size[work.args.pixel_patch.data[p]], 1);
}

__device__ uint32_t AgreesOf(const PairWork& work, int a, int b) {
  const int64_t words = work.args.label_words;
  const uint64_t* labels = work.args.labels.data;
  uint32_t agrees = 0;
  for (int scale = 0; scale < work.num_scales; ++scale) {
    uint64_t common = 0;
    for (int64_t w = 0; w < words; ++w) common |= labels[a * words + w] & labels[b * words + w];
    agrees |= static_cast<uint32_t>(common != 0) << scale;
    labels += work.args.num_patches * words;
  }
  return agrees;
}

// A thread a pair of patches: G at all scales, and how many pairs of pixels that is.
__global__ void __launch_bounds__(kBlock) CompareKernel(PairWork work) {
  const int num_patches = work.args.num_patches;
  const int a = static_cast<int>(blockIdx.y);
  const int b = static_cast<int>(blockIdx.x * kBlock + threadIdx.x);
  uint32_t agrees = 0;
  uint64_t num_pairs = 0;
  if (b < num_patches) {
    agrees = AgreesOf(work, a, b);
    work.agrees[int64_t{a} * num_patches + b] = agrees;
    const uint64_t size = work.patch_size[a];
    if (b < a) num_pairs = size * static_cast<uint64_t>(work.patch_size[b]);
    if (b == a) num_pairs = size * (size - 1) / 2;
  }
  const uint32_t all = (1u << work.num_scales) - 1u;
  const uint64_t positive = WarpSum(agrees == all ? num_pairs : 0);
  const uint64_t negative = WarpSum(agrees == 0 ? num_pairs : 0);
  const uint64_t hard = WarpSum(agrees != 0 && agrees != all ? num_pairs : 0);
  if (threadIdx.x % 32 != 0) return;
  if (positive > 0) atomicAdd(&work.counts->constant_positive, positive);
  if (negative > 0) atomicAdd(&work.counts->constant_negative, negative);
  if (hard > 0) atomicAdd(&work.counts->hard, hard);
}

}  // namespace

void LaunchGatePixels(const PairWork& work, cudaStream_t stream) {
  GateKernel<<<NumBlocks(work.padded, kWarps) + 1, kBlock, 0, stream>>>(work);
}

void LaunchComparePatches(const PairWork& work, cudaStream_t stream) {
  const dim3 grid(NumBlocks(work.args.num_patches, kBlock), work.args.num_patches);
  CompareKernel<<<grid, kBlock, 0, stream>>>(work);
}

}  // namespace pepeseg
