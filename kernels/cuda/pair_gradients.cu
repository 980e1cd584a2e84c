#include <cuda_runtime.h>

#include "kernels/cuda/pair_work.cuh"
#include "kernels/cuda/tensor_core.cuh"
#include "kernels/math/feature.h"

// Third pass of PairLoss: from the plan to the gradients of the normalised gated features,
//   unit_grad_p = sum over q of (d loss / d C_pq) F_q / |psi * F_q|,
// without the factor psi, which pair_loss.cu applies. It is a product of matrices: one over (p,
// q) that the bits of the plan and the weights generate on the fly, and one over (q, channel). It
// runs on the tensor cores, in tf32 with each factor split in two (tensor_core.cuh).
//
// A block owns 128 pixels p, two scales and one of kPairSplits parts of the pixels q; a warp
// owns 32 of the p and all 32 channels, a lane 4 of the p against 2 channels of each 8. The block
// takes 32 q at a time: its threads load their features and inverse norms, split them, and store
// them to one of two buffers in shared memory (Columns), while all warps multiply the other. One
// __syncthreads per 32 q is enough: it separates the stores to a buffer from its reads, and the
// reads of the buffer before last from the stores that replace it. Words of the plan go straight to
// registers, a batch ahead.
//
// Each sum is in one thread's registers, over q in a fixed order, and the parts have places of
// their own, which pair_loss.cu adds in order: results are the same in every run.

namespace pepeseg {
namespace {

constexpr int kRows = kPairPad;  // pixels p of a block
constexpr int kWarpRows = 32;    // pixels p of a warp: two products of 16
constexpr int kColumns = 32;     // pixels q at a time
constexpr int kScales = 2;       // scales of a block, which share words of the plan and weights
constexpr int kBlock = kRows / kWarpRows * 32;
constexpr int kParts = kFeatureSize / 8;  // products, of 8 channels each

// Shared memory: F / |psi F| of 32 pixels q at two scales, and their weights. A word has two q at
// one channel, their high parts, then their low parts. The padding of the rows keeps the lanes of a
// product in different banks.
struct Columns {
  alignas(16) uint4 at[kScales][kColumns / 2][kFeatureSize + 2];
  alignas(16) float weight[kColumns];
};

// The order of the q in a product is free if both factors have the same. Lane j of four reads the
// plan in runs of four q, 16 h + 4 j to 16 h + 4 j + 3. Step 2 h + k multiplies two q of a run,
// q = 16 h + 4 j + 2 k + e with e = 0 or 1, as number j + 4 e of its eight. Returns the row of
// Columns for two such q, number `pair` among the 16 of a batch.
__device__ int PlaceOf(int pair) { return (pair / 8 * 2 + pair % 2) * 4 + pair / 2 % 4; }

// A thread's part of Columns in registers, between load and store: two q at every eighth channel.
constexpr int kEighths = kFeatureSize / 8;
static_assert(kBlock == kColumns / 2 * 8);
struct Fetched {
  float feature[2][kEighths];
  float2 inv_norm[kScales];
  float weight;
};
// Loads the thread's part for the q from `first` on; zeros in the padding.
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
// Splits the thread's part and stores it to shared memory.
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

// A lane's four pixels p, 8 apart from `p` on, and the gradient of the cosine of a pair: base +
// slope * weight of q, one for pairs that pull and one for pairs that push.
struct Rows {
  int p;
  float pull_base, push_base, pull_slope[4], push_slope[4];
};

// Divides by the numbers of positives and negatives, or of both with joint_mean, as the losses are
// means.
__device__ Rows RowsOf(const PairWork& work, int p) {
  const PairWeights weights = *work.weights;
  const auto positives = work.counts->positives, negatives = work.counts->negatives;
  const bool joint = work.args.joint_mean;
  const float pull = PositiveTermVjp(Inverse(positives + (joint ? negatives : 0)));
  const float push = Inverse(negatives + (joint ? positives : 0));
  Rows rows = {p, pull * weights.base, push * weights.base, {}, {}};
#pragma unroll
  for (int k = 0; k < 4; ++k) {
    const float weight = work.args.pixel_weight.data[min(p + 8 * k, work.num_pixels - 1)];
    rows.pull_slope[k] = pull * weights.slope * weight;
    rows.push_slope[k] = push * weights.slope * weight;
  }
  return rows;
}

// Words of the plan for a lane's four pixels p and its two runs of four q.
struct Words {
  uint4 bits[4][2];
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

// A lane's sums: by scale, product of 16 p, product of 8 channels, and element of the product.
struct Sums {
  float at[kScales][2][kParts][4];
};

// Bits and gradients of two q of a run against the four p, as the elements of two products.
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

// Multiplies the gradients of one step with its q, at one scale. `column` is the lane's word of the
// first eight channels.
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

// Adds the 32 q in shared memory to the sums.
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

// Writes a lane's sums at one scale to the place of this block's part.
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

// blockIdx: pixels p, scales, part of the q. A part may be empty; its sums are 0.
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
    // The next 32 q are loaded while these are multiplied. The last round loads its own again, so
    // that no branch is needed; nothing reads them.
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
