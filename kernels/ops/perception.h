#pragma once

#include <cstdint>

#include "kernels/ops/feature.h"

// Arguments of the perception loss of stage two (METHOD.md section 3, "Perception loss").

namespace pepeseg {

// What colour and depth indicate about a pair of pixels, at all scales: bit k is set if the pair is
// similar at scale k, bit kDissimilarShift + k if it is dissimilar. Where both are set, similar
// wins.
using PairCues = uint32_t;
inline constexpr int kDissimilarShift = 16;
static_assert(kMaxScales <= kDissimilarShift);

// L_p: mean over scales of [mean over similar pairs of (1 - C) + mean over dissimilar pairs of
// max(C, 0)], where C is the cosine of psi(s) * F(p) and psi(s) * F(q). Which pairs there are does
// not depend on any feature, so they are listed, and their numbers known, in advance. Adds
// weight * d L_p to the gradients. S is the number of sampled pixels.
struct PerceptionLossArgs {
  DeviceSpan<const float> pixel_features;  // [S, 32] F
  // The pairs by pixel; each pair is listed twice, under either of its pixels.
  DeviceSpan<const int32_t> first;  // [S + 1] first entry of each pixel
  DeviceSpan<const int32_t> other;  // [entries] the other pixel, in [0, S)
  DeviceSpan<const PairCues> cues;  // [entries]
  // Weight of a pair at a scale: of similar pairs, then of dissimilar ones. Each is
  // 1 / (num_scales * number of those pairs at that scale).
  DeviceSpan<const float> share;   // [2, num_scales]
  DeviceSpan<const float> scales;  // [num_scales] quantile scales; at most kMaxScales
  DeviceSpan<const float> gate;    // [kGateSize] or [kTwoLayerGateSize]
  float weight = 1;                // factor of the gradients; not of `loss`
  DeviceSpan<float> pixel_grad;    // [S, 32] in and out: added to
  DeviceSpan<float> gate_grad;     // as gate, in and out: added to
  DeviceSpan<double> loss;         // [1] L_p
};

}  // namespace pepeseg
