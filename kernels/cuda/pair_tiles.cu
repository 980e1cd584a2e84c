#include <cuda_runtime.h>

#include "kernels/cuda/pair_work.cuh"
#include "kernels/math/pair.h"

namespace pepeseg {
namespace {

constexpr int kOwn = 4;  // a thread has kOwn x kOwn pairs
constexpr int kSide = kPairTile / kOwn;
constexpr int kBlock = kSide * kSide;
constexpr double kMinHardShare = 0.05;  // of all pairs, for the number of easy ones

// A constant-positive resp. -negative pair is drawn when its 31-bit hash is below.
struct DrawLimits {
  int32_t positive, negative;
};

// Channel by channel, pixels side by side.
struct Side {
  float at[kFeatureSize][kPairTile];
};
struct Tile {
  alignas(16) Side row_features, columns;
  alignas(16) Side rows[2];  // psi^2 / |psi F| times the rows' features, of this scale and the next
  float psi2[kMaxScales][kFeatureSize];
  DrawLimits limits;
};

// Pixels row + i against column + j.
struct Pairs {
  int row, column;
  uint32_t bits[kOwn][kOwn];  // agrees, and above kPushShift: the cosine is positive
  uint32_t violates;          // bit kOwn i + j
  float positive[kOwn][kOwn], negative[kOwn][kOwn];  // sums over the scales, of weight 1
};

// So that the draws give the asked number of easy pairs on average (the CPU's PairPlan).
__device__ DrawLimits LimitDraws(const PairWork& work) {
  const auto positive = static_cast<double>(work.counts->constant_positive);
  const auto negative = static_cast<double>(work.counts->constant_negative);
  const auto counted = static_cast<double>(work.counts->hard);
  const double hard = max(counted, kMinHardShare * (counted + positive + negative));
  const auto limit = [&](double available) {
    const double wanted = static_cast<double>(work.args.easy_share) * hard;
    const double share = available == 0 ? 0 : min(1.0, wanted / available);
    return static_cast<int32_t>(share * 2147483647.0);
  };
  return {limit(positive), limit(negative)};
}

// 31 random bits for a pair; the same for (p, q) and (q, p).
__device__ int32_t PairHash(uint32_t p, uint32_t q, uint32_t seed) {
  uint32_t h = (max(p, q) << 16 | min(p, q)) ^ seed;
  h = (h ^ h >> 16) * 0x7feb352du;
  h = (h ^ h >> 15) * 0x846ca68bu;
  return static_cast<int32_t>((h ^ h >> 16) >> 1);
}

__device__ void LoadSide(const PairWork& work, int first, Side& side) {
  constexpr int kWords = kFeatureSize / 4, kWordsOfThread = kWords * kPairTile / kBlock;
  const int lane = static_cast<int>(threadIdx.x) % kPairTile;
  const int part = static_cast<int>(threadIdx.x) / kPairTile;
  const auto* features = reinterpret_cast<const float4*>(work.args.pixel_features.data);
#pragma unroll
  for (int i = 0; i < kWordsOfThread; ++i) {
    const int word = part * kWordsOfThread + i;
    float4 f = {0, 0, 0, 0};
    if (first + lane < work.num_pixels) f = features[(first + lane) * kWords + word];
    side.at[4 * word][lane] = f.x;
    side.at[4 * word + 1][lane] = f.y;
    side.at[4 * word + 2][lane] = f.z;
    side.at[4 * word + 3][lane] = f.w;
  }
}

__device__ void ScaleRows(const PairWork& work, int scale, int first, Tile& tile) {
  const int lane = static_cast<int>(threadIdx.x) % kPairTile;
  const int part = static_cast<int>(threadIdx.x) / kPairTile;
  const float inv_norm = work.inv_norm[scale * work.padded + first + lane];
  Side& rows = tile.rows[scale & 1];
#pragma unroll
  for (int k = part; k < kFeatureSize; k += kBlock / kPairTile) {
    rows.at[k][lane] = tile.row_features.at[k][lane] * (tile.psi2[scale][k] * inv_norm);
  }
}

__device__ void BeginPairs(const PairWork& work, Pairs& pairs) {
  const int32_t* patch = work.args.pixel_patch.data;
  const int last = work.num_pixels - 1;
  pairs.violates = 0;
#pragma unroll
  for (int i = 0; i < kOwn; ++i) {
    const int64_t row = int64_t{patch[min(pairs.row + i, last)]} * work.args.num_patches;
#pragma unroll
    for (int j = 0; j < kOwn; ++j) {
      pairs.bits[i][j] = work.agrees[row + patch[min(pairs.column + j, last)]];
      pairs.positive[i][j] = pairs.negative[i][j] = 0;
    }
  }
}

// The dot products of a thread's pairs.
__device__ void Correlate(const Side& rows, const Side& columns, float (&sum)[kOwn][kOwn]) {
  const int row = static_cast<int>(threadIdx.x) / kSide * kOwn;
  const int column = static_cast<int>(threadIdx.x) % kSide * kOwn;
#pragma unroll
  for (int k = 0; k < kFeatureSize; ++k) {
    const float4 a = *reinterpret_cast<const float4*>(&rows.at[k][row]);
    const float4 b = *reinterpret_cast<const float4*>(&columns.at[k][column]);
    const float of_row[kOwn] = {a.x, a.y, a.z, a.w}, of_column[kOwn] = {b.x, b.y, b.z, b.w};
#pragma unroll
    for (int i = 0; i < kOwn; ++i) {
#pragma unroll
      for (int j = 0; j < kOwn; ++j) sum[i][j] = MulAdd(of_row[i], of_column[j], sum[i][j]);
    }
  }
}

// A pair's cosine at one scale.
__device__ void AddCosine(const PairWork& work, int scale, float cosine, int at, Pairs& pairs) {
  const int i = at / kOwn, j = at % kOwn;
  const bool agrees = (pairs.bits[i][j] >> scale & 1u) != 0;
  const bool violates = agrees ? cosine < work.args.min_positive : work.args.max_negative < cosine;
  pairs.violates |= static_cast<uint32_t>(violates) << at;
  pairs.bits[i][j] |= static_cast<uint32_t>(0 < cosine) << (kPushShift + scale);
  pairs.positive[i][j] += agrees ? PositiveTerm(1.0f, cosine) : 0.0f;
  pairs.negative[i][j] += agrees ? 0.0f : NegativeTerm(1.0f, cosine);
}

__device__ void AddScale(const PairWork& work, int scale, const Tile& tile, Pairs& pairs) {
  float sum[kOwn][kOwn] = {};
  Correlate(tile.rows[scale & 1], tile.columns, sum);
  const float* inv_norm = work.inv_norm + scale * work.padded + pairs.column;
#pragma unroll
  for (int at = 0; at < kOwn * kOwn; ++at) {
    AddCosine(work, scale, sum[at / kOwn][at % kOwn] * inv_norm[at % kOwn], at, pairs);
  }
}

// What a thread's pairs add.
struct Totals {
  float positive = 0, negative = 0;
  int num_positives = 0, num_negatives = 0;
};

// Turns the bits of a pair into its word of the plan.
__device__ void Choose(const PairWork& work, const DrawLimits& limits, int at, Pairs& pairs,
                       Totals& totals) {
  const int i = at / kOwn, j = at % kOwn, p = pairs.row + i, q = pairs.column + j;
  const uint32_t all = (1u << work.num_scales) - 1u, agrees = pairs.bits[i][j] & all;
  const bool hard = agrees != 0 && agrees != all;
  const int32_t hash =
      PairHash(static_cast<uint32_t>(p), static_cast<uint32_t>(q), work.args.pair_seed);
  const bool drawn = hash < (agrees == 0 ? limits.negative : limits.positive);
  const bool violates = (pairs.violates >> at & 1u) != 0;
  // Pairs of pixels with themselves and the mirrored half of a tile on the diagonal do not count.
  const bool counts = (hard || drawn || violates) && p < q && q < work.num_pixels;
  const uint32_t pulls = counts ? agrees : 0, pushes = counts ? ~agrees & all : 0;
  pairs.bits[i][j] = pulls | (pairs.bits[i][j] & pushes << kPushShift);
  if (!counts) return;
  const float* weights = work.args.pixel_weight.data;
  const PairWeights scaled = *work.weights;
  const float weight = MulAdd(scaled.slope * weights[p], weights[q], scaled.base);
  totals.positive = MulAdd(weight, pairs.positive[i][j], totals.positive);
  totals.negative = MulAdd(weight, pairs.negative[i][j], totals.negative);
  totals.num_positives += __popc(pulls);
  totals.num_negatives += __popc(pushes);
}

__device__ void StorePlan(const PairWork& work, const Pairs& pairs) {
  const auto& bits = pairs.bits;
  const int64_t row = pairs.row, column = pairs.column, padded = work.padded;
#pragma unroll
  for (int i = 0; i < kOwn; ++i) {
    *reinterpret_cast<uint4*>(&work.plan[(row + i) * padded + column]) = {bits[i][0], bits[i][1],
                                                                          bits[i][2], bits[i][3]};
    *reinterpret_cast<uint4*>(&work.plan[(column + i) * padded + row]) = {bits[0][i], bits[1][i],
                                                                          bits[2][i], bits[3][i]};
  }
}
// Within a tile on the diagonal only one of (p, q) and (q, p) counts: it fills both places.
__device__ void StoreDiagonalPlan(const PairWork& work, const Pairs& pairs) {
#pragma unroll
  for (int at = 0; at < kOwn * kOwn; ++at) {
    const int64_t p = pairs.row + at / kOwn, q = pairs.column + at % kOwn;
    if (p > q) continue;
    work.plan[p * work.padded + q] = pairs.bits[at / kOwn][at % kOwn];
    work.plan[q * work.padded + p] = pairs.bits[at / kOwn][at % kOwn];
  }
}

// In a fixed order, so that the sums are the same each time.
__device__ void AddTotals(const PairWork& work, const Totals& totals) {
  __shared__ PairLossPart of_warp[kBlock / 32];
  auto positive = static_cast<double>(totals.positive);
  auto negative = static_cast<double>(totals.negative);
  for (int offset = 16; offset > 0; offset /= 2) {
    positive += __shfl_xor_sync(~0u, positive, offset);
    negative += __shfl_xor_sync(~0u, negative, offset);
  }
  const int num_positives = __reduce_add_sync(~0u, totals.num_positives);
  const int num_negatives = __reduce_add_sync(~0u, totals.num_negatives);
  if (threadIdx.x % 32 == 0) {
    of_warp[threadIdx.x / 32] = {positive, negative};
    if (num_positives > 0) atomicAdd(&work.counts->positives, num_positives);
    if (num_negatives > 0) atomicAdd(&work.counts->negatives, num_negatives);
  }
  __syncthreads();
  if (threadIdx.x != 0) return;
  PairLossPart sum = {0, 0};
  for (const PairLossPart& part : of_warp) {
    sum.positive += part.positive;
    sum.negative += part.negative;
  }
  work.tile_part[blockIdx.x] = sum;
}

// Tiles (i, j), i <= j, numbered by j, then by i.
__device__ int2 TileOf(int number) {
  int j = static_cast<int>((sqrtf(8.0f * static_cast<float>(number) + 1) - 1) / 2);
  while (j * (j + 1) / 2 > number) --j;
  while ((j + 1) * (j + 2) / 2 <= number) ++j;
  return {number - j * (j + 1) / 2, j};
}

// A block a tile of pairs at all scales, which the choice of pairs couples.
__global__ void __launch_bounds__(kBlock) TileKernel(PairWork work) {
  __shared__ Tile tile;
  const int2 place = TileOf(static_cast<int>(blockIdx.x));
  const int first_row = place.x * kPairTile, first_column = place.y * kPairTile;
  for (int i = static_cast<int>(threadIdx.x); i < work.num_scales * kFeatureSize; i += kBlock) {
    tile.psi2[i / kFeatureSize][i % kFeatureSize] = work.psi[i] * work.psi[i];
  }
  if (threadIdx.x == 0) tile.limits = LimitDraws(work);
  LoadSide(work, first_row, tile.row_features);
  LoadSide(work, first_column, tile.columns);
  Pairs pairs;
  pairs.row = first_row + static_cast<int>(threadIdx.x) / kSide * kOwn;
  pairs.column = first_column + static_cast<int>(threadIdx.x) % kSide * kOwn;
  BeginPairs(work, pairs);
  __syncthreads();
  ScaleRows(work, 0, first_row, tile);
  for (int scale = 0; scale < work.num_scales; ++scale) {
    __syncthreads();
    if (scale + 1 < work.num_scales) ScaleRows(work, scale + 1, first_row, tile);
    AddScale(work, scale, tile, pairs);
  }
  Totals totals;
#pragma unroll
  for (int at = 0; at < kOwn * kOwn; ++at) Choose(work, tile.limits, at, pairs, totals);
  if (place.x == place.y) {
    StoreDiagonalPlan(work, pairs);
  } else {
    StorePlan(work, pairs);
  }
  AddTotals(work, totals);
}

}  // namespace

void LaunchPairTiles(const PairWork& work, cudaStream_t stream) {
  TileKernel<<<NumPairTiles(work), kBlock, 0, stream>>>(work);
}

}  // namespace pepeseg
