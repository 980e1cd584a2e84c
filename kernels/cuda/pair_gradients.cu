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

// F / |psi F| of some pixels q, a word two q at a channel: the high parts, then the low parts. The
// stride keeps the lanes of a product in different banks.
struct Columns {
  alignas(16) uint4 at[kScales][kColumns / 2][kFeatureSize + 2];
  alignas(16) float weight[kColumns];
};

// A lane j of four reads the plan in runs of four q, 16 h + 4 j to 16 h + 4 j + 3, of which a
// product takes two: q = 16 h + 4 j + 2 k + e in step 2 h + k, as number j + 4 e of its eight. The
// place of two such q among the steps' rows:
__device__ int PlaceOf(int pair) { return (pair / 8 * 2 + pair % 2) * 4 + pair / 2 % 4; }

// A thread's part of Columns on its way: two q at every eighth channel.
constexpr int kEighths = kFeatureSize / 8;
static_assert(kBlock == kColumns / 2 * 8);
struct Fetched {
  float feature[2][kEighths];
  float2 inv_norm[kScales];
  float weight;
};
__device__ void FetchColumns(const PairWork& work, int first_scale, int first, Fetched& fetched) {
  const int q = first + static_cast<int>(threadIdx.x) / 8 * 2;
#pragma unroll
  for (int e = 0; e < 2; ++e) {
    const float* feature = work.args.pixel_features.data + (q + e) * kFeatureSize + threadIdx.x % 8;
#pragma unroll
    for (int k = 0; k < kEighths; ++k) {
      fetched.feature[e][k] = q + e < work.num_pixels ? feature[8 * k] : 0.0f;
    }
  }
#pragma unroll
  for (int s = 0; s < kScales; ++s) {
    const int scale = min(first_scale + s, work.num_scales - 1);
    fetched.inv_norm[s] = *reinterpret_cast<const float2*>(&work.inv_norm[scale * work.padded + q]);
  }
  const int own = first + static_cast<int>(threadIdx.x) % kColumns;
  fetched.weight = work.args.pixel_weight.data[min(own, work.num_pixels - 1)];
}
__device__ void StoreColumns(const Fetched& fetched, Columns& columns) {
  const int place = PlaceOf(static_cast<int>(threadIdx.x) / 8);
#pragma unroll
  for (int s = 0; s < kScales; ++s) {
#pragma unroll
    for (int k = 0; k < kEighths; ++k) {
      const TwoParts one = Split(fetched.inv_norm[s].x * fetched.feature[0][k]);
      const TwoParts other = Split(fetched.inv_norm[s].y * fetched.feature[1][k]);
      columns.at[s][place][threadIdx.x % 8 + 8 * k] = {one.high, other.high, one.low, other.low};
    }
  }
  if (threadIdx.x < kColumns) columns.weight[threadIdx.x] = fetched.weight;
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

__device__ void AddProducts(const PairGrads& grads, int scale, const uint4* column,
                            float (&sum)[2][kParts][4]) {
  SplitB b[kParts];
#pragma unroll
  for (int part = 0; part < kParts; ++part) {
    const uint4 word = column[8 * part];
    b[part] = {{word.x, word.y}, {word.z, word.w}};
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
      AddProducts(grads, first_scale + s, &columns.at[s][4 * step + lane % 4][lane / 4],
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
__global__ void __launch_bounds__(kBlock, 2) UnitGradientKernel(PairWork work) {
  __shared__ Columns columns[2];
  const int warp = static_cast<int>(threadIdx.x) / 32, lane = static_cast<int>(threadIdx.x) % 32;
  const int p = static_cast<int>(blockIdx.x) * kRows + kWarpRows * warp + lane / 4;
  const int first_scale = static_cast<int>(blockIdx.y) * kScales;
  const int split = static_cast<int>(blockIdx.z), num_batches = work.padded / kColumns;
  const int begin = num_batches * split / kPairSplits;
  const int end = num_batches * (split + 1) / kPairSplits;
  const Rows rows = RowsOf(work, p);
  Sums sums = {};
  Words words;
  Fetched fetched;
  if (begin < end) {
    LoadWords(work, begin * kColumns, p, words);
    FetchColumns(work, first_scale, begin * kColumns, fetched);
    StoreColumns(fetched, columns[begin % 2]);
  }
  for (int i = begin; i < end; ++i) {
    __syncthreads();
    // The next are on their way while these are multiplied; the last are fetched once more.
    const int next = min(i + 1, end - 1) * kColumns;
    Words next_words;
    LoadWords(work, next, p, next_words);
    FetchColumns(work, first_scale, next, fetched);
    AddColumns(rows, words, first_scale, columns[i % 2], sums);
    StoreColumns(fetched, columns[(i + 1) % 2]);
    words = next_words;
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
