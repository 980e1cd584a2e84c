#include <cuda_runtime.h>

#include "kernels/cuda/pair_work.cuh"
#include "kernels/cuda/tensor_core.cuh"
#include "kernels/math/feature.h"

// Second pass of PairLoss: the cosines of all pairs p < q at all scales, the plan of which pairs
// count, and the losses.
//
// One block per tile of 32x32 pairs on or above the diagonal, 16x16 of them per warp, eight per
// lane, at all scales: whether a pair counts depends on its cosines at all scales, so they are in
// one thread. A cosine is sum_k psi_k^2 F_pk F_qk times both inverse norms (pair_plan.cu). The sums
// are products of matrices on the tensor cores, in tf32 with each factor split in two
// (tensor_core.cuh), to about the precision of float. Only the side of p changes with the scale;
// that of q is split once.
//
// Shared memory holds psi^2, the limits of the draw, and the sums of the warps; one __syncthreads
// precedes the loop over the scales, one the sum over the warps. Features are in registers.
//
// A word of the plan is written by one thread, mirrored to (q, p). Losses are added over a lane's
// pairs, by shuffles over the warp, over the warps, and later over the tiles (pair_loss.cu), in
// double from the warp on and in fixed orders; counts are integer atomics. So the results are the
// same in every run.

namespace pepeseg {
namespace {

// The draw of easy pairs (see PairLossArgs), the same as on the CPU (kernels/cpu/pair_loss.cc): a
// constant-positive, or constant-negative, pair is drawn if its 31-bit hash is below the limit.
struct DrawLimits {
  int32_t positive, negative;
};

// Limits that draw, on average, easy_share pairs of each kind for each hard pair, or as for
// kMinHardShare of all pairs if fewer are hard. Reads the counts of pair_plan.cu.
__device__ DrawLimits LimitDraws(const PairWork& work) {
  constexpr double kMinHardShare = 0.05;  // of all pairs, for the number of easy ones
  const auto positive = static_cast<double>(work.counts->constant_positive / 2);
  const auto negative = static_cast<double>(work.counts->constant_negative / 2);
  const auto counted = static_cast<double>(work.counts->hard / 2);
  const double hard = max(counted, kMinHardShare * (counted + positive + negative));
  const auto limit = [&](double available) {
    const double wanted = static_cast<double>(work.args.easy_share) * hard;
    const double share = available == 0 ? 0 : min(1.0, wanted / available);
    return static_cast<int32_t>(share * 2147483647.0);
  };
  const double half = (positive + negative) / 2;  // as on the CPU
  if (work.args.joint_mean) return {limit(half), limit(half)};
  return {limit(positive), limit(negative)};
}

// Returns 31 random bits for a pair, the same for (p, q) and (q, p). p and q are below 2^16.
__device__ int32_t PairHash(uint32_t p, uint32_t q, uint32_t seed) {
  uint32_t h = (max(p, q) << 16 | min(p, q)) ^ seed;
  h = (h ^ h >> 16) * 0x7feb352du;
  h = (h ^ h >> 15) * 0x846ca68bu;
  return static_cast<int32_t>((h ^ h >> 16) >> 1);
}

// Pairs of a lane: pixels row + 8 i against columns column + 8 part + j, with i, part and j 0 or 1.
// The order of channels in a product is free if both sides have the same: lane j of four holds
// channels 8 j to 8 j + 7, so that it loads whole words, and step k multiplies two of them.
constexpr int kWarps = 4;
constexpr int kBlock = 32 * kWarps;
constexpr int kParts = 2, kPairs = 4 * kParts;
constexpr int kSteps = 4, kChannels = 2 * kSteps;

// Shared memory of a block.
struct Shared {
  alignas(16) float psi2[kMaxScales][kFeatureSize];
  DrawLimits limits;
  PairLossPart of_warp[kWarps];
};

// The eight pairs of a lane, numbered `at`.
struct Pairs {
  int row, column;
  uint32_t bits[kPairs];  // G by scale; above kPushShift: the cosine is above the margin
  uint32_t violates;      // bit `at`
  float positive[kPairs], negative[kPairs];  // sums over the scales, of weight 1

  __device__ int RowOf(int at) const { return row + at % 4 / 2 * 8; }
  __device__ int ColumnOf(int at) const { return column + at / 4 * 8 + at % 2; }
};

// The channels that a lane holds, of two row pixels as they are and of two column pixels split.
struct Sides {
  float row[2][kChannels];
  SplitB column[kParts][kSteps];
};

// Loads the lane's eight channels of a pixel; zeros in the padding.
__device__ void LoadChannels(const PairWork& work, int pixel, float (&channel)[kChannels]) {
  const int j = static_cast<int>(threadIdx.x) % 4;
  const auto* words = reinterpret_cast<const float4*>(work.args.pixel_features.data);
#pragma unroll
  for (int k = 0; k < kChannels / 4; ++k) {
    float4 f = {0, 0, 0, 0};
    if (pixel < work.num_pixels) f = words[(pixel * 4 + j) * (kChannels / 4) + k];
    channel[4 * k] = f.x;
    channel[4 * k + 1] = f.y;
    channel[4 * k + 2] = f.z;
    channel[4 * k + 3] = f.w;
  }
}

__device__ void LoadSides(const PairWork& work, int first_row, int first_column, Sides& sides) {
  const int i = static_cast<int>(threadIdx.x) % 32 / 4;
  LoadChannels(work, first_row + i, sides.row[0]);
  LoadChannels(work, first_row + i + 8, sides.row[1]);
#pragma unroll
  for (int part = 0; part < kParts; ++part) {
    float channel[kChannels];
    LoadChannels(work, first_column + 8 * part + i, channel);
#pragma unroll
    for (int k = 0; k < kSteps; ++k) {
      const TwoParts one = Split(channel[2 * k]), other = Split(channel[2 * k + 1]);
      sides.column[part][k] = {{one.high, other.high}, {one.low, other.low}};
    }
  }
}

// Looks up G of the lane's pairs at all scales. Pixels of the padding take the mask cell of the
// last pixel; Choose rejects their pairs.
__device__ void BeginPairs(const PairWork& work, Pairs& pairs) {
  const int32_t* cell = work.args.pixel_cell.data;
  const int last = work.num_pixels - 1;
  pairs.violates = 0;
#pragma unroll
  for (int at = 0; at < kPairs; ++at) {
    const int64_t row = cell[min(pairs.RowOf(at), last)];
    pairs.bits[at] = work.agrees[row * work.args.num_cells + cell[min(pairs.ColumnOf(at), last)]];
    pairs.positive[at] = pairs.negative[at] = 0;
  }
}

// Computes sum_k psi_k^2 F_pk F_qk of the lane's pairs, by the whole warp.
__device__ void Correlate(const Sides& sides, const float* psi2, float (&sum)[kParts][4]) {
  const auto* words = reinterpret_cast<const float4*>(psi2);
  const float4 a = words[threadIdx.x % 4 * 2], b = words[threadIdx.x % 4 * 2 + 1];
  const float scale[kChannels] = {a.x, a.y, a.z, a.w, b.x, b.y, b.z, b.w};
  float mixed[kParts][4] = {};
#pragma unroll
  for (int k = 0; k < kSteps; ++k) {
    const SplitA rows = SplitOf(
        {scale[2 * k] * sides.row[0][2 * k], scale[2 * k] * sides.row[1][2 * k],
         scale[2 * k + 1] * sides.row[0][2 * k + 1], scale[2 * k + 1] * sides.row[1][2 * k + 1]});
#pragma unroll
    for (int part = 0; part < kParts; ++part) {
      Multiply(rows, sides.column[part][k], sum[part], mixed[part]);
    }
  }
#pragma unroll
  for (int at = 0; at < kPairs; ++at) sum[at / 4][at % 4] += mixed[at / 4][at % 4];
}

// Records the cosine of pair `at` at one scale: whether it violates its label, whether it is above
// the margin of negatives, and its terms of weight 1.
__device__ void AddCosine(const PairWork& work, int scale, float cosine, int at, Pairs& pairs) {
  const bool agrees = (pairs.bits[at] >> scale & 1u) != 0;
  const bool violates = agrees ? cosine < work.args.min_positive : work.args.max_negative < cosine;
  if (violates) pairs.violates |= 1u << at;
  const float margin = work.args.negative_margin;
  if (margin < cosine) pairs.bits[at] |= 1u << (kPushShift + scale);
  if (agrees) {
    pairs.positive[at] += PositiveTerm(1.0f, cosine);
  } else {
    pairs.negative[at] += NegativeTerm(1.0f, cosine, margin);
  }
}

// Computes and records the cosines of the lane's pairs at one scale.
__device__ void AddScale(const PairWork& work, int scale, const Sides& sides, const float* psi2,
                         Pairs& pairs) {
  const float* inv_norm = work.inv_norm + scale * work.padded;
  const float rows[2] = {inv_norm[pairs.row], inv_norm[pairs.row + 8]};
  float2 columns[kParts];
#pragma unroll
  for (int part = 0; part < kParts; ++part) {
    columns[part] = *reinterpret_cast<const float2*>(inv_norm + pairs.column + 8 * part);
  }
  float sum[kParts][4] = {};
  Correlate(sides, psi2, sum);
#pragma unroll
  for (int at = 0; at < kPairs; ++at) {
    const float column = at % 2 == 0 ? columns[at / 4].x : columns[at / 4].y;
    AddCosine(work, scale, sum[at / 4][at % 4] * (rows[at % 4 / 2] * column), at, pairs);
  }
}

// Sums over the pairs of a lane that count.
struct Totals {
  float positive = 0, negative = 0;
  int num_positives = 0, num_negatives = 0;
};

// Decides whether pair `at` counts, turns its bits into its word of the plan, and adds its terms.
__device__ void Choose(const PairWork& work, const DrawLimits& limits, int at, Pairs& pairs,
                       Totals& totals) {
  const int p = pairs.RowOf(at), q = pairs.ColumnOf(at);
  const uint32_t all = (1u << work.num_scales) - 1u, agrees = pairs.bits[at] & all;
  const bool hard = agrees != 0 && agrees != all;
  const int32_t hash =
      PairHash(static_cast<uint32_t>(p), static_cast<uint32_t>(q), work.args.pair_seed);
  const bool drawn = hash < (agrees == 0 ? limits.negative : limits.positive);
  const bool violates = (pairs.violates >> at & 1u) != 0;
  // In a tile on the diagonal only the pairs above the diagonal count.
  const bool counts = (hard || drawn || violates) && p < q && q < work.num_pixels;
  const uint32_t pulls = counts ? agrees : 0, pushes = counts ? ~agrees & all : 0;
  pairs.bits[at] = pulls | (pairs.bits[at] & pushes << kPushShift);
  if (!counts) return;
  const float* weights = work.args.pixel_weight.data;
  const PairWeights scaled = *work.weights;
  const float weight = MulAdd(scaled.slope * weights[p], weights[q], scaled.base);
  totals.positive = MulAdd(weight, pairs.positive[at], totals.positive);
  totals.negative = MulAdd(weight, pairs.negative[at], totals.negative);
  totals.num_positives += __popc(pulls);
  totals.num_negatives += __popc(pushes);
}

// Stores the words at (p, q) and (q, p): the plan is symmetric. In a tile on the diagonal another
// lane has (q, p), whose word would be 0; it is not stored.
__device__ void StorePlan(const PairWork& work, const Pairs& pairs, bool on_diagonal) {
#pragma unroll
  for (int at = 0; at < kPairs; ++at) {
    const int64_t p = pairs.RowOf(at), q = pairs.ColumnOf(at);
    if (on_diagonal && p > q) continue;
    work.plan[p * work.padded + q] = pairs.bits[at];
    work.plan[q * work.padded + p] = pairs.bits[at];
  }
}

// Adds the sums of the block in a fixed order and stores them. Called by all threads.
__device__ void AddTotals(const PairWork& work, const Totals& totals, Shared& shared) {
  auto positive = static_cast<double>(totals.positive);
  auto negative = static_cast<double>(totals.negative);
  for (int offset = 16; offset > 0; offset /= 2) {
    positive += __shfl_xor_sync(~0u, positive, offset);
    negative += __shfl_xor_sync(~0u, negative, offset);
  }
  const int num_positives = __reduce_add_sync(~0u, totals.num_positives);
  const int num_negatives = __reduce_add_sync(~0u, totals.num_negatives);
  if (threadIdx.x % 32 == 0) {
    shared.of_warp[threadIdx.x / 32] = {positive, negative};
    if (num_positives > 0) atomicAdd(&work.counts->positives, num_positives);
    if (num_negatives > 0) atomicAdd(&work.counts->negatives, num_negatives);
  }
  __syncthreads();
  if (threadIdx.x != 0) return;
  PairLossPart sum = {0, 0};
  for (const PairLossPart& part : shared.of_warp) {
    sum.positive += part.positive;
    sum.negative += part.negative;
  }
  work.tile_part[blockIdx.x] = sum;
}

// Returns tile (i, j), i <= j, of a number. Tiles are numbered by j, then by i. The loops correct
// the rounding of the root.
__device__ int2 TileOf(int number) {
  int j = static_cast<int>((sqrtf(8.0f * static_cast<float>(number) + 1) - 1) / 2);
  while (j * (j + 1) / 2 > number) --j;
  while ((j + 1) * (j + 2) / 2 <= number) ++j;
  return {number - j * (j + 1) / 2, j};
}

// Block b has tile number b.
__global__ void __launch_bounds__(kBlock, 4) TileKernel(PairWork work) {
  __shared__ Shared shared;
  const int2 tile = TileOf(static_cast<int>(blockIdx.x));
  const int warp = static_cast<int>(threadIdx.x) / 32, lane = static_cast<int>(threadIdx.x) % 32;
  const int first_row = tile.x * kPairTile + warp / 2 * 16;
  const int first_column = tile.y * kPairTile + warp % 2 * 16;
  for (int i = static_cast<int>(threadIdx.x); i < work.num_scales * kFeatureSize; i += kBlock) {
    shared.psi2[i / kFeatureSize][i % kFeatureSize] = work.psi[i] * work.psi[i];
  }
  if (threadIdx.x == 0) shared.limits = LimitDraws(work);
  Sides sides;
  LoadSides(work, first_row, first_column, sides);
  Pairs pairs;
  pairs.row = first_row + lane / 4;
  pairs.column = first_column + lane % 4 * 2;
  BeginPairs(work, pairs);
  __syncthreads();
#pragma unroll 1
  for (int scale = 0; scale < work.num_scales; ++scale) {
    AddScale(work, scale, sides, shared.psi2[scale], pairs);
  }
  Totals totals;
#pragma unroll
  for (int at = 0; at < kPairs; ++at) Choose(work, shared.limits, at, pairs, totals);
  StorePlan(work, pairs, tile.x == tile.y);
  AddTotals(work, totals, shared);
}

}  // namespace

void LaunchPairTiles(const PairWork& work, cudaStream_t stream) {
  TileKernel<<<NumPairTiles(work), kBlock, 0, stream>>>(work);
}

}  // namespace pepeseg
