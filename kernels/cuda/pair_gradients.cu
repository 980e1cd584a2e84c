#include <cuda_runtime.h>

#include "kernels/cuda/pair_work.cuh"
#include "kernels/cuda/tensor_core.cuh"
#include "kernels/math/pair.h"

namespace pepeseg {
namespace {

constexpr int kRows = kPairPad;  // pixels p of a block
constexpr int kWarpRows = 32;    // of a warp: two products of 16
constexpr int kColumns = 32;     // pixels q at a time
constexpr int kScales = 2;       // at once: they share the words of the plan and the weights
constexpr int kBlock = kRows / kWarpRows * 32;
constexpr int kParts = kFeatureSize / 8;  // products of 8 channels

// F / |psi F| of some pixels q, in the order of SlotOf. The stride keeps the lanes of a product in
// different banks.
struct Columns {
  alignas(16) TwoParts at[kScales][kColumns][kFeatureSize + 4];
  alignas(16) float weight[kColumns];
};

// A lane j of four reads the plan in runs of four q, 16 h + 4 j to 16 h + 4 j + 3, of which a
// product takes two: q = 16 h + 4 j + 2 k + e in step 2 h + k, as number j + 4 e of its eight.
__device__ int SlotOf(int q) { return (q / 16 * 2 + q / 2 % 2) * 8 + q / 4 % 4 + q % 2 * 4; }

__device__ void LoadColumns(const PairWork& work, int first_scale, int first, Columns& columns) {
  constexpr int kWords = kFeatureSize / 4;
  const auto* features = reinterpret_cast<const float4*>(work.args.pixel_features.data);
#pragma unroll
  for (int i = static_cast<int>(threadIdx.x); i < kColumns * kWords; i += kBlock) {
    const int q = first + i / kWords, slot = SlotOf(i / kWords), channel = i % kWords * 4;
    float4 f = {0, 0, 0, 0};
    if (q < work.num_pixels) f = features[q * kWords + i % kWords];
    const float feature[4] = {f.x, f.y, f.z, f.w};
#pragma unroll
    for (int s = 0; s < kScales; ++s) {
      const int scale = min(first_scale + s, work.num_scales - 1);
      const float inv_norm = work.inv_norm[scale * work.padded + q];
#pragma unroll
      for (int k = 0; k < 4; ++k) {
        columns.at[s][slot][channel + k] = Split(inv_norm * feature[k]);
      }
    }
  }
  if (threadIdx.x >= kColumns) return;
  const int q = first + static_cast<int>(threadIdx.x);
  columns.weight[threadIdx.x] = q < work.num_pixels ? work.args.pixel_weight.data[q] : 0.0f;
}

// Of a lane's four pixels p: 8 apart, from `p` on.
struct Rows {
  int p;
  // d loss / d cosine is base + slope * weight of q, where the pair pulls resp. pushes.
  float pull_base, push_base, pull_slope[4], push_slope[4];
};

__device__ Rows RowsOf(const PairWork& work, int p) {
  const PairWeights weights = *work.weights;
  const float pull = PositiveTermVjp(Inverse(work.counts->positives));
  const float push = Inverse(work.counts->negatives);
  Rows rows = {p, pull * weights.base, push * weights.base, {}, {}};
#pragma unroll
  for (int k = 0; k < 4; ++k) {
    const float weight = work.args.pixel_weight.data[min(p + 8 * k, work.num_pixels - 1)];
    rows.pull_slope[k] = pull * weights.slope * weight;
    rows.push_slope[k] = push * weights.slope * weight;
  }
  return rows;
}

struct Words {
  uint4 bits[4][2];  // of a pixel p and a run of q
};
__device__ void LoadWords(const PairWork& work, int first, int p, Words& words) {
  const int q = first + static_cast<int>(threadIdx.x) % 4 * 4;
#pragma unroll
  for (int k = 0; k < 4; ++k) {
#pragma unroll
    for (int h = 0; h < 2; ++h) {
      words.bits[k][h] = *reinterpret_cast<const uint4*>(
          &work.plan[int64_t{p + 8 * k} * work.padded + q + 16 * h]);
    }
  }
}

struct Sums {
  float at[kScales][2][kParts][4];
};

// Two q of a run against the four p, as the numbers of two products.
struct PairGrads {
  uint32_t bits[2][4];
  float pull[2][4], push[2][4];
};
__device__ PairGrads PairGradsOf(const Rows& rows, const Words& words, const float4& weights,
                                 int step) {
  PairGrads out;
#pragma unroll
  for (int k = 0; k < 4; ++k) {
    const uint4 run = words.bits[k][step / 2];
    const bool late = step % 2 != 0;
    const uint32_t bits[2] = {late ? run.z : run.x, late ? run.w : run.y};
    const float weight[2] = {late ? weights.z : weights.x, late ? weights.w : weights.y};
#pragma unroll
    for (int e = 0; e < 2; ++e) {
      out.bits[k / 2][k % 2 + 2 * e] = bits[e];
      out.pull[k / 2][k % 2 + 2 * e] = MulAdd(rows.pull_slope[k], weight[e], rows.pull_base);
      out.push[k / 2][k % 2 + 2 * e] = MulAdd(rows.push_slope[k], weight[e], rows.push_base);
    }
  }
  return out;
}

__device__ void AddProducts(const PairGrads& grads, int scale, const TwoParts* column,
                            float (&sum)[2][kParts][4]) {
  constexpr int kFourRows = 4 * (kFeatureSize + 4);
  SplitB b[kParts];
#pragma unroll
  for (int part = 0; part < kParts; ++part) {
    const TwoParts one = column[8 * part], other = column[8 * part + kFourRows];
    b[part] = {{one.high, other.high}, {one.low, other.low}};
  }
  const uint32_t pulls = 1u << scale, pushes = pulls << kPushShift;
#pragma unroll
  for (int m = 0; m < 2; ++m) {
    float cosine_grad[4];
#pragma unroll
    for (int e = 0; e < 4; ++e) {
      const float pushed = (grads.bits[m][e] & pushes) != 0 ? grads.push[m][e] : 0.0f;
      cosine_grad[e] = (grads.bits[m][e] & pulls) != 0 ? grads.pull[m][e] : pushed;
    }
    const SplitA a = SplitOf(cosine_grad);
#pragma unroll
    for (int part = 0; part < kParts; ++part) Multiply(a, b[part], sum[m][part]);
  }
}

__device__ void AddColumns(const Rows& rows, const Words& words, int first_scale,
                           const Columns& columns, Sums& sums) {
  const int lane = static_cast<int>(threadIdx.x) % 32;
#pragma unroll
  for (int step = 0; step < kColumns / 8; ++step) {
    const float4 weights =
        *reinterpret_cast<const float4*>(&columns.weight[step / 2 * 16 + lane % 4 * 4]);
    const PairGrads grads = PairGradsOf(rows, words, weights, step);
#pragma unroll
    for (int s = 0; s < kScales; ++s) {
      AddProducts(grads, first_scale + s, &columns.at[s][8 * step + lane % 4][lane / 4],
                  sums.at[s]);
    }
  }
}

__device__ void StoreSums(const PairWork& work, int scale, int p,
                          const float (&sum)[2][kParts][4]) {
  const int channel = static_cast<int>(threadIdx.x) % 4 * 2;
  const int64_t row = (int64_t{blockIdx.z} * work.num_scales + scale) * work.padded + p;
#pragma unroll
  for (int m = 0; m < 2; ++m) {
#pragma unroll
    for (int part = 0; part < kParts; ++part) {
      float* to = work.unit_grad + (row + 16 * m) * kFeatureSize + 8 * part + channel;
      *reinterpret_cast<float2*>(to) = {sum[m][part][0], sum[m][part][1]};
      *reinterpret_cast<float2*>(to + 8 * kFeatureSize) = {sum[m][part][2], sum[m][part][3]};
    }
  }
}

// sum over q of (d loss / d cosine) F_q / |psi F_q|, for kRows pixels p at kScales scales, over one
// part of the q.
__global__ void __launch_bounds__(kBlock, 3) UnitGradientKernel(PairWork work) {
  __shared__ Columns columns;
  const int warp = static_cast<int>(threadIdx.x) / 32, lane = static_cast<int>(threadIdx.x) % 32;
  const int p = static_cast<int>(blockIdx.x) * kRows + kWarpRows * warp + lane / 4;
  const int first_scale = static_cast<int>(blockIdx.y) * kScales;
  const int split = static_cast<int>(blockIdx.z), num_batches = work.padded / kColumns;
  const Rows rows = RowsOf(work, p);
  Sums sums = {};
  const int end = num_batches * (split + 1) / kPairSplits;
  for (int i = num_batches * split / kPairSplits; i < end; ++i) {
    Words words;
    LoadWords(work, i * kColumns, p, words);
    __syncthreads();
    LoadColumns(work, first_scale, i * kColumns, columns);
    __syncthreads();
    AddColumns(rows, words, first_scale, columns, sums);
  }
#pragma unroll
  for (int s = 0; s < kScales; ++s) {
    if (first_scale + s < work.num_scales) StoreSums(work, first_scale + s, p, sums.at[s]);
  }
}

}  // namespace

void LaunchUnitGradients(const PairWork& work, cudaStream_t stream) {
  const dim3 grid(work.padded / kRows, (work.num_scales + kScales - 1) / kScales, kPairSplits);
  UnitGradientKernel<<<grid, kBlock, 0, stream>>>(work);
}

}  // namespace pepeseg
