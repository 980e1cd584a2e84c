#pragma once

#include <cuda_runtime.h>

#include <cstdint>

#include "kernels/cuda/cuda_backend.h"
#include "kernels/ops/feature.h"

// Working memory and passes of PairLoss (PairLossArgs in kernels/ops/feature.h; METHOD.md section
// 3, "Contrastive loss"). pair_loss.cu is the op and has the last two passes; those before it
// are in pair_plan.cu, pair_tiles.cu and pair_gradients.cu. Each is one launch, and the stream
// orders them: a pass reads what the passes before it have written to global memory.
//
// Floats are never added by atomics: every partial sum has a place of its own, and a later pass
// adds the places in a fixed order. Only counts, which are integers, are atomic. So losses and
// gradients are the same in every run.

namespace pepeseg {

// Counts of one PairLoss, added by integer atomics. They start as 0.
struct PairCounts {
  // Ordered pairs (p, q), so twice the number of pairs: those whose G changes with the scale, and
  // those whose G is 1, or 0, at all scales.
  unsigned long long hard, constant_positive, constant_negative;
  // Number of (pair, scale) with G = 1, and with G = 0, of the pairs that count.
  unsigned long long positives, negatives;
  unsigned long long norm_pixels;  // pixels with alpha > min_norm_alpha
};

// Weight of a pair: w = base + slope * product of the pixels' weights.
struct PairWeights {
  float base, slope;
};

// Sums of the terms of one tile of pairs: -w C over its positives, w max(C - margin, 0) over its
// negatives.
struct PairLossPart {
  double positive, negative;
};

// A word of the plan, one for each ordered pair. Bit k: the pair counts and is positive at scale k
// (it pulls). Bit 16 + k: it counts, is negative at scale k, and its cosine is above the margin (it
// pushes), so that the gradient needs no cosine. 0 for pairs that do not count.
using PairBits = uint32_t;
inline constexpr int kPushShift = 16;
static_assert(kMaxScales <= kPushShift);

inline constexpr int kPairTile = 32;   // pixels per side of a tile of pairs
inline constexpr int kPairSplits = 6;  // parts into which the sum over the other pixels q is split
inline constexpr int kPairPad = 128;   // pixels are padded to a multiple of this
inline constexpr int kPixelWarps = 8;  // pixels, and warps, a block of PixelGradientKernel

// Arguments and working memory of all passes. The arrays are in the backend's temporary memory.
struct PairWork {
  PairLossArgs args;
  int num_pixels, padded, num_scales;  // padded: num_pixels rounded up to a multiple of kPairPad
  PairCounts* counts;
  PairWeights* weights;     // [1]
  float* psi;               // [scales, 32] the gate
  float* inv_norm;          // [scales, padded] 1 / |psi * F|, 0 in the padding
  uint32_t* agrees;         // [num_cells, num_cells] bit k: G at scale k
  PairBits* plan;           // [padded, padded] symmetric
  PairLossPart* tile_part;  // [tiles]
  // Gradient of the normalised gated feature of each pixel, divided by psi, by part of the sum.
  float* unit_grad;   // [splits, scales, padded, 32]
  float* psi_grad;    // [pixel blocks, scales, 32] gradient of psi
  double* norm_loss;  // [pixel blocks] sum of the norm terms
};

// Number of tiles on and above the diagonal.
inline int NumPairTiles(const PairWork& work) {
  const int side = work.padded / kPairTile;
  return side * (side + 1) / 2;
}
inline int NumPixelBlocks(const PairWork& work) {
  return (work.num_pixels + kPixelWarps - 1) / kPixelWarps;
}

// Returns 1 / count, or 0 if nothing counts.
__device__ inline float Inverse(unsigned long long count) {
  return count == 0 ? 0.0f : static_cast<float>(1 / static_cast<double>(count));
}

// The passes before the last two, in their order.
//
// The gate, the weights, G of all pairs of mask cells and the counts of pairs by G; and the norms
// of the gated features.
void LaunchPairPlan(const PairWork& work, cudaStream_t stream);
// Cosines of all pairs at all scales, which are not stored: the plan of which pairs count, and the
// losses.
void LaunchPairTiles(const PairWork& work, cudaStream_t stream);
// From the plan to the gradients of units.
void LaunchUnitGradients(const PairWork& work, cudaStream_t stream);

}  // namespace pepeseg
