#pragma once

#include <cstdint>

#include "kernels/ops/feature.h"
#include "kernels/ops/perception.h"

// What the inner loops of stage two work on (kernels/cpu/simd/features.cc, pairs.cc).

namespace pepeseg {

inline constexpr int kPairColumns = 16;  // pixels q that are worked on at once
inline constexpr int kPairRows = 32;     // pixels p of a task

// Shared by the tasks of one PairLoss. Rows of pixels are padded with zeros to `padded`.
struct PairJob {
  const PairLossArgs* args;
  int num_pixels, padded, num_scales;
  const float* psi;                 // [scales, 32]
  const int32_t* patch;             // [padded]
  const uint32_t* agrees;           // [patches, patches] bit k: G at scale k
  float weight_base, weight_slope;  // w = base + slope * product of the pixels' weights
  const float* pixel_weight;        // [padded]
  // A constant-positive resp. -negative pair is drawn when its 31-bit hash is below.
  int32_t positive_limit, negative_limit;
  float* unit;             // [scales, padded, 32] psi * F, normalised
  float* unit_by_channel;  // the same as [scales, padded / 16, 32, 16]: columns side by side
  float* unit_grad;        // [2, scales, padded, 32] of the positives' sum and of the negatives'
  // For the last pass: 1 / counts.
  float positive_scale, negative_scale, norm_scale;
};

// Pixels [first, end) and what they add; sums are over ordered pairs, twice what they should be.
struct PairBlock {
  int first, end;
  double sums[kNumPairLossSums];
  float psi_grad[kMaxScales * kFeatureSize];
};

// Shared by the tasks of one PerceptionLoss.
struct PerceptionJob {
  const PerceptionLossArgs* args;
  int num_scales;
  const float* psi;  // [scales, 32]
  float* unit;       // [S, scales, 32] psi * F, normalised; only of pixels with a pair
};

// Pixels [first, end) and what they add; the loss is of ordered pairs, twice what it should be.
struct PerceptionBlock {
  int64_t first, end;
  double loss;
  float psi_grad[kMaxScales * kFeatureSize];
};

struct FeatureRange {
  int64_t first, end;
};

}  // namespace pepeseg
