#include <cuda_runtime.h>

#include "kernels/cuda/channel.cuh"
#include "kernels/cuda/cuda_backend.h"
#include "kernels/cuda/pair_work.cuh"

// First pass of PairLoss: everything that does not need cosines. One launch with three kinds of
// blocks, which do not depend on each other:
//   block 0           psi, the scaling of the weights, and the number of pixels in the norm term
//   one per mask cell G of the cell with every cell at all scales (one thread per cell), then the
//                     number of its pixels' pairs with all pixels by G (every 256th
//                     pixel per thread)
//   the others        one warp per pixel, one lane per channel: 1 / |psi * F| at all scales
// Pixels of a mask cell have the same labels, so G is compared by cell and not by pixel.
//
// __syncthreads separates the steps within a block. Counts are integer atomics, within the block in
// shared memory and between blocks in global memory; the extremes of the weights are exact in any
// order. So the results are the same in every run.

namespace pepeseg {
namespace {

constexpr int kBlock = 256;
constexpr int kWarps = kBlock / 32;

// The two smallest and the two largest of a set of numbers, the more extreme first.
struct Extremes {
  float low[2], high[2];
};
__device__ Extremes Merge(const Extremes& a, const Extremes& b) {
  return {{min(a.low[0], b.low[0]), min(max(a.low[0], b.low[0]), min(a.low[1], b.low[1]))},
          {max(a.high[0], b.high[0]), max(min(a.high[0], b.high[0]), max(a.high[1], b.high[1]))}};
}
// Extremes over the lanes of a warp, in every lane.
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

// Scales the weights of pairs to [1, 10]: the smallest product is that of the two smallest weights,
// the largest that of the two largest. All become 1 if those differ by at most 1e-6 of the largest,
// or if there is no pair.
__device__ PairWeights ScaleWeights(const Extremes& of_all, int num_pixels) {
  if (num_pixels < 2) return {1, 0};
  const double low = static_cast<double>(of_all.low[0]) * static_cast<double>(of_all.low[1]);
  const double high = static_cast<double>(of_all.high[0]) * static_cast<double>(of_all.high[1]);
  constexpr double kRange = 9;  // to [1, 10]
  if (high - low <= 1e-6 * high) return {1, 0};
  return {static_cast<float>(1 - kRange * low / (high - low)),
          static_cast<float>(kRange / (high - low))};
}

// One channel of psi at a scale.
__device__ float PsiOf(const PairWork& work, int scale, int channel) {
  return PsiChannel(work.args.gate, work.args.scales.data[scale], channel);
}

// Finds psi, the scaling of the weights, and the number of pixels in the norm term. One block.
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

// Writes 1 / |psi * F| of pixel p at all scales, by one warp; 0 for the padding.
__device__ void GatePixel(const PairWork& work, int p) {
  const int lane = static_cast<int>(threadIdx.x) % 32;
  if (p >= work.padded) return;
  const bool is_pixel = p < work.num_pixels;
  const Channel feature(is_pixel ? work.args.pixel_features.data[p * kFeatureSize + lane] : 0.0f);
#pragma unroll 4
  for (int scale = 0; scale < work.num_scales; ++scale) {
    const Channel psi(PsiOf(work, scale, lane));
    Channel unit(0);
    const Channel inv_norm = GatedUnit(&psi, &feature, 1, &unit);
    if (lane == 0) work.inv_norm[scale * work.padded + p] = is_pixel ? inv_norm.v : 0.0f;
  }
}

// Returns G of two mask cells: bit k is set if their labels at scale k intersect.
__device__ uint32_t AgreesOf(const PairWork& work, int a, int b) {
  const int64_t words = work.args.label_words, stride = work.args.num_cells * words;
  const uint64_t *of_a = work.args.labels.data + a * words, *of_b = of_a + (b - a) * words;
  uint32_t agrees = 0;
  for (int64_t w = 0; w < words; ++w) {
#pragma unroll
    for (int scale = 0; scale < kMaxScales; ++scale) {  // all loads in flight at once
      const int64_t at = min(scale, work.num_scales - 1) * stride + w;
      const bool common = (of_a[at] & of_b[at]) != 0 && scale < work.num_scales;
      agrees |= static_cast<uint32_t>(common) << scale;
    }
  }
  return agrees;
}

// Number of pixels in a mask cell, and of all pixels by G with it.
struct PixelClasses {
  int own, positive, negative, hard;
};

// Adds the pixels of the batch to `classes`, which is in shared memory. `agrees_row` is the cell's
// row of `agrees`.
__device__ void CountClasses(const PairWork& work, const uint32_t* agrees_row, int cell,
                             PixelClasses& classes) {
  const uint32_t all = (1u << work.num_scales) - 1u;
  PixelClasses own = {};
  for (int p = static_cast<int>(threadIdx.x); p < work.num_pixels; p += kBlock) {
    const int other = work.args.pixel_cell.data[p];
    const uint32_t agrees = agrees_row[other];
    own.own += other == cell ? 1 : 0;
    own.positive += agrees == all ? 1 : 0;
    own.negative += agrees == 0 ? 1 : 0;
    own.hard += agrees != all && agrees != 0 ? 1 : 0;
  }
  if (own.own > 0) atomicAdd(&classes.own, own.own);
  if (own.positive > 0) atomicAdd(&classes.positive, own.positive);
  if (own.negative > 0) atomicAdd(&classes.negative, own.negative);
  if (own.hard > 0) atomicAdd(&classes.hard, own.hard);
}

// Writes a mask cell's row of `agrees` and counts the ordered pairs of its pixels with all other
// pixels. One block a cell.
__device__ void ComparePatch(const PairWork& work, int cell) {
  __shared__ PixelClasses classes;
  uint32_t* row = work.agrees + int64_t{cell} * work.args.num_cells;
  if (threadIdx.x == 0) classes = {};
  for (int b = static_cast<int>(threadIdx.x); b < work.args.num_cells; b += kBlock) {
    row[b] = AgreesOf(work, cell, b);
  }
  __syncthreads();
  CountClasses(work, row, cell, classes);
  __syncthreads();
  if (threadIdx.x != 0 || classes.own == 0) return;
  const uint32_t all = (1u << work.num_scales) - 1u, agrees = row[cell];
  // has_itself: the pixels counted include the pixel p of the pair itself.
  const auto add = [&](unsigned long long& pairs, int count, bool has_itself) {
    const int others = count - static_cast<int>(has_itself);
    if (others > 0) atomicAdd(&pairs, uint64_t{1} * classes.own * others);
  };
  add(work.counts->constant_positive, classes.positive, agrees == all);
  add(work.counts->constant_negative, classes.negative, agrees == 0);
  add(work.counts->hard, classes.hard, agrees != all && agrees != 0);
}

__global__ void __launch_bounds__(kBlock) PlanKernel(PairWork work) {
  const int block = static_cast<int>(blockIdx.x), num_cells = work.args.num_cells;
  if (block == 0) return SurveyPixels(work);
  if (block <= num_cells) return ComparePatch(work, block - 1);
  GatePixel(work, (block - 1 - num_cells) * kWarps + static_cast<int>(threadIdx.x) / 32);
}

}  // namespace

void LaunchPairPlan(const PairWork& work, cudaStream_t stream) {
  const int num_blocks = 1 + work.args.num_cells + NumBlocks(work.padded, kWarps);
  PlanKernel<<<num_blocks, kBlock, 0, stream>>>(work);
}

}  // namespace pepeseg
