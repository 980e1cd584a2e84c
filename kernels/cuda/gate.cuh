#pragma once

#include "kernels/cuda/channel.cuh"
#include "kernels/math/gate.h"
#include "kernels/ops/feature.h"

// The scale gate in a warp, a channel a lane (formulas in kernels/math/gate.h).

namespace pepeseg {

static_assert(kGateHidden == kFeatureSize, "a lane has a channel and a hidden unit");
static_assert(kTwoLayerGateSize == TwoLayerGateSize(kFeatureSize));

// Channel `channel` of psi at a scale.
__device__ inline float PsiChannel(DeviceSpan<const float> gate, float scale, int channel) {
  return GateChannel(GateNumbers<float>{gate.data, gate.size}, kFeatureSize, channel, scale);
}

// Adds the gradients of a gate of two layers at one scale, from bias_grad, a lane's channel of the
// gradient of b2. Called by a whole warp, which alone writes gate_grad. Lane j keeps the gradient
// of hidden unit j, which a butterfly of shuffles sums over the channels; each lane then adds to
// numbers of its own, so that nothing needs a barrier.
__device__ inline void AddTwoLayerGrad(const float* gate, float scale, float bias_grad,
                                       float* gate_grad) {
  const int lane = static_cast<int>(threadIdx.x) % 32;
  float hidden_grad = 0;
  for (int j = 0; j < kGateHidden; ++j) {
    const int at = 2 * kGateHidden + j * kFeatureSize + lane;
    const float sum = Total(Channel(gate[at] * bias_grad)).v;
    if (lane == j) hidden_grad = sum;
    gate_grad[at] = MulAdd(HiddenUnit(gate, j, scale), bias_grad, gate_grad[at]);
  }
  gate_grad[2 * kGateHidden + kGateHidden * kFeatureSize + lane] += bias_grad;
  if (!(HiddenUnit(gate, lane, scale) > 0)) return;
  gate_grad[lane] = MulAdd(scale, hidden_grad, gate_grad[lane]);
  gate_grad[kGateHidden + lane] += hidden_grad;
}

}  // namespace pepeseg
