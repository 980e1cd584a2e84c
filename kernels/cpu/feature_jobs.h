#pragma once

#include <cstdint>

#include "kernels/ops/feature.h"
#include "kernels/ops/perception.h"

// Tasks of the inner loops of stage two (kernels/cpu/simd/features.cc, pairs.cc, perception.cc).

namespace pepeseg {

inline constexpr int kPairColumns = 16;  // pixels q that are worked on together
inline constexpr int kPairRows = 32;     // pixels p of a task

// What the tasks of one PairLoss share. Arrays over pixels are padded with zeros to `padded`, a
// multiple of kPairRows.
struct PairJob {
  const PairLossArgs* args;
  int num_pixels, padded, num_scales;
  const float* psi;                 // [scales, 32]
  const int32_t* patch;             // [padded]
  const uint32_t* agrees;           // [patches, patches] of mask cells; bit k: G at scale k
  float weight_base, weight_slope;  // w = base + slope * product of the pixels' weights
  const float* pixel_weight;        // [padded]
  // A constant positive (negative) pair is drawn if its 31-bit hash is below the limit.
  int32_t positive_limit, negative_limit;
  float* unit;             // [scales, padded, 32] psi * F, normalised
  float* unit_by_channel;  // the same, channel by channel: [scales, padded / 16, 32, 16]
  float* unit_grad;        // [2, scales, padded, 32] of the sum over positives, then negatives
  // Read by the last pass: 1 / counts.
  float positive_scale, negative_scale, norm_scale;
};

// Pixels p in [first, end) and their sums. Sums of pairs are over ordered pairs, so twice the loss.
struct PairBlock {
  int first, end;
  double sums[kNumPairLossSums];
  float psi_grad[kMaxScales * kFeatureSize];
};

// What the tasks of one PerceptionLoss share.
struct PerceptionJob {
  const PerceptionLossArgs* args;
  int num_scales;
  const float* psi;  // [scales, 32]
  float* unit;       // [S, scales, 32] psi * F, normalised; set only for pixels with a pair
};

// Pixels in [first, end) and their sums. The loss is over ordered pairs, so twice L_p.
struct PerceptionBlock {
  int64_t first, end;
  double loss;
  float psi_grad[kMaxScales * kFeatureSize];
};

// Rows, pixels or touched Gaussians [first, end).
struct FeatureRange {
  int64_t first, end;
};

}  // namespace pepeseg
