#pragma once

#include <cstdint>

#include "kernels/math/hd.h"
#include "kernels/ops/feature.h"

// The tasks of PairLoss on the CPU: see SimdKernels (kernels/cpu/simd_kernels.h).
namespace pepeseg {

inline constexpr int kPairTile = 16;  // pixels p, and pixels q, that are worked on together
inline constexpr int kPairRows = 32;  // pixels p of a task
// Pixels a side of a panel of pairs, so that the memory for the choice of pairs is bounded.
inline constexpr int kPairPanel = 2048;

// Data shared by the tasks of one PairLoss. Arrays over pixels are padded with zeros to `padded`, a
// multiple of kPairRows.
struct PairJob {
  const PairLossArgs* args;
  int num_pixels, padded, num_scales;
  const float* psi;                 // [scales, 32]
  const int32_t* cell;              // [padded]
  const uint32_t* agrees;           // [cells, cells]; bit k: G at scale k
  float weight_base, weight_slope;  // w = base + slope * product of the pixels' weights
  const float* pixel_weight;        // [padded]
  // A constant positive (negative) pair is drawn if its 31-bit hash is below the limit.
  int32_t positive_limit, negative_limit;
  float* unit;             // [scales, padded, 32] psi * F, normalised
  float* unit_by_channel;  // the same, channel by channel: [scales, padded / 16, 32, 16]
  float* unit_grad;        // [2, scales, padded, 32] of the sum over positives, then negatives
  // Read by the last pass: 1 / counts.
  float positive_scale, negative_scale, norm_scale;

  PEPESEG_HD int tile_words() const { return 2 * num_scales * kPairTile; }  // of the bits of a tile
};

// Pixels p in [first_row, end_row) and q in [first_column, end_column), multiples of kPairRows, of
// which the columns are the rows or come after them. The pairs that count are bits: a word of
// kPairTile pixels q for each p, each scale, and each of positives and negatives with a gradient.
// The words of a tile of kPairTile pixels p and as many q are next to each other:
// [rows / kPairTile, columns / kPairTile, 2, num_scales, kPairTile].
struct PairPanel {
  int first_row, end_row, first_column, end_column;
  uint16_t* bits;
  // The same pairs with p and q swapped; `bits` if rows and columns are the same.
  uint16_t* mirrored;

  PEPESEG_HD bool diagonal() const { return first_row == first_column; }
  PEPESEG_HD PairPanel Swapped() const {
    return {first_column, end_column, first_row, end_row, mirrored, bits};
  }
  // Position of the first word of pixel p in the tile of p and q.
  PEPESEG_HD int64_t WordOf(const PairJob& job, int p, int q) const {
    const int64_t columns = (end_column - first_column) / kPairTile;
    const int64_t tile = (p - first_row) / kPairTile * columns + (q - first_column) / kPairTile;
    return tile * job.tile_words() + (p - first_row) % kPairTile;
  }
};

// Pixels p in [first, end) and their sums.
struct PairBlock {
  int first, end;
  double sums[kNumPairLossSums];
  float psi_grad[kMaxScales * kFeatureSize];
};

}  // namespace pepeseg
