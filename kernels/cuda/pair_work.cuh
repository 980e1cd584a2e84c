#pragma once

#include <cuda_runtime.h>

#include <cstdint>

#include "kernels/cuda/arena.h"
#include "kernels/ops/feature.h"

namespace pepeseg {

// Counts of one PairLoss, added up by atomics: integers, so in any order. They start as 0.
struct PairCounts {
  // All pairs by their labels, each both ways round: G the same at all scales or not.
  unsigned long long hard, constant_positive, constant_negative;
  // Of the chosen pairs, (pair, scale).
  unsigned long long positives, negatives;
  unsigned long long norm_pixels;
};

// w = base + slope * product of the pixels' weights.
struct PairWeights {
  float base, slope;
};

// What a tile of pairs or a block of pixels adds to the losses.
struct PairLossPart {
  double positive, negative;
};

// A word of the plan: bit k is set where the pair pulls at scale k, bit 16 + k where it pushes and
// its cosine is positive, so that the gradient needs no cosine. 0 for pairs that are not chosen.
using PairBits = uint32_t;
inline constexpr int kPushShift = 16;
static_assert(kMaxScales <= kPushShift);

inline constexpr int kPairTile = 32;   // pixels a side of a tile of pairs
inline constexpr int kPairSplits = 6;  // parts of the sum over the other pixels of a pair
inline constexpr int kPairPad = 128;   // pixels are padded to a multiple of this
inline constexpr int kPixelWarps = 8;  // pixels a block in the pass over pixels

// What the kernels of PairLoss share. Arrays stand in the backend's temporary memory.
struct PairWork {
  PairLossArgs args;
  int num_pixels, padded, num_scales;
  PairCounts* counts;
  PairWeights* weights;     // [1]
  float* psi;               // [scales, 32]
  float* inv_norm;          // [scales, padded] 1 / |psi * F|, 0 in the padding
  uint32_t* agrees;         // [num_patches, num_patches] bit k: G at scale k
  PairBits* plan;           // [padded, padded] symmetric
  PairLossPart* tile_part;  // [tiles]
  // The gradient of the normalised gated features over psi, by part of the sum.
  float* unit_grad;   // [splits, scales, padded, 32]
  float* psi_grad;    // [pixel blocks, scales, 32]
  double* norm_loss;  // [pixel blocks]
};

// Lays the arrays out; to be called on an empty arena first to learn their size.
PairWork TakePairWork(const PairLossArgs& args, Arena& arena);

inline int NumPairTiles(const PairWork& work) {
  const int side = work.padded / kPairTile;
  return side * (side + 1) / 2;
}
inline int NumPixelBlocks(const PairWork& work) {
  return (work.num_pixels + kPixelWarps - 1) / kPixelWarps;
}

// 0 where nothing counts.
__device__ inline float Inverse(unsigned long long count) {
  return count == 0 ? 0.0f : static_cast<float>(1 / static_cast<double>(count));
}

// The passes, in their order. What depends on no feature, and the norms of gated features:
void LaunchPairPlan(const PairWork& work, cudaStream_t stream);
// Cosines of all pairs at all scales, never stored: which pairs count, and the losses.
void LaunchPairTiles(const PairWork& work, cudaStream_t stream);
// From the plan to the gradients; the sums of all passes.
void LaunchUnitGradients(const PairWork& work, cudaStream_t stream);
void LaunchPixelGradients(const PairWork& work, cudaStream_t stream);
void LaunchPairSums(const PairWork& work, cudaStream_t stream);

}  // namespace pepeseg
