#pragma once

#include <cstdint>

#include "kernels/ops/feature.h"

// Arguments of the perception loss of stage two (METHOD.md section 3).

namespace pepeseg {

// What colour and depth say of a pair of pixels, at all scales: bit k is set where it is similar at
// scale k, bit kDissimilarShift + k where it is dissimilar.
using PairCues = uint32_t;
inline constexpr int kDissimilarShift = 16;
static_assert(kMaxScales <= kDissimilarShift);

// L_p: mean over scales of [mean over similar pairs of (1 - C) + mean over dissimilar pairs of
// max(C, 0)], with C the cosine of psi(s) * F(p) and psi(s) * F(q). Which pairs there are, and how
// many, depends on no feature: they are listed ahead. Adds to the gradients.
struct PerceptionLossArgs {
  DeviceSpan<const float> pixel_features;  // [S, 32]
  // The pairs by pixel, each both ways round.
  DeviceSpan<const int32_t> first;  // [S + 1]
  DeviceSpan<const int32_t> other;  // [entries] -> pixel
  DeviceSpan<const PairCues> cues;  // [entries]
  // What a similar resp. dissimilar pair weighs at a scale: 1 / (scales * their number).
  DeviceSpan<const float> share;   // [2, num_scales]
  DeviceSpan<const float> scales;  // [num_scales] quantile scales; at most kMaxScales
  DeviceSpan<const float> gate;    // [kGateSize]
  float weight = 1;                // of the term
  DeviceSpan<float> pixel_grad;    // [S, 32] added to
  DeviceSpan<float> gate_grad;     // [kGateSize] added to
  DeviceSpan<double> loss;         // [1] L_p
};

}  // namespace pepeseg
