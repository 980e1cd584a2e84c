#pragma once

#include "kernels/math/blend.h"

// The scale gate of stage two (METHOD.md section 3): psi(s) = sigmoid(W s + b), channel by channel.
// s is a query scale in [0, 2], psi in (0, 1).

namespace pepeseg {

// One channel of psi(s).
template <class T>
PEPESEG_HD T Gate(T weight, T bias, T scale) {
  return Sigmoid(MulAdd(weight, scale, bias));
}
// Writes psi[count] at one scale. `gate` holds `count` weights, then `count` biases.
template <class T>
PEPESEG_HD void GateAt(const T* gate, int count, T scale, T* psi) {
  for (int k = 0; k < count; ++k) psi[k] = Gate(gate[k], gate[count + k], scale);
}
// Gradient of the bias of a channel, from that of psi. The gradient of its weight is `scale` times
// as large.
template <class T>
PEPESEG_HD T GateVjp(T psi, T psi_grad) {
  return SigmoidVjp(psi, psi_grad);
}
// Adds the gradients of weights and biases, from that of psi, to gate_grad[2 * count].
template <class T>
PEPESEG_HD void GateAtVjp(const T* psi, const T* psi_grad, int count, T scale, T* gate_grad) {
  for (int k = 0; k < count; ++k) {
    const T bias_grad = GateVjp(psi[k], psi_grad[k]);
    gate_grad[k] = MulAdd(scale, bias_grad, gate_grad[k]);
    gate_grad[count + k] += bias_grad;
  }
}

}  // namespace pepeseg
