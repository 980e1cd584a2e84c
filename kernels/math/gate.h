#pragma once

#include "kernels/math/blend.h"

namespace pepeseg {

// psi(s) = sigmoid(W s + b), one channel of it.
template <class T>
PEPESEG_HD T Gate(T weight, T bias, T scale) {
  return Sigmoid(MulAdd(weight, scale, bias));
}
// psi at one scale: [count] channels of a gate with `count` weights, then as many biases.
template <class T>
PEPESEG_HD void GateAt(const T* gate, int count, T scale, T* psi) {
  for (int k = 0; k < count; ++k) psi[k] = Gate(gate[k], gate[count + k], scale);
}
// The gradient of the bias; that of the weight is `scale` times it.
template <class T>
PEPESEG_HD T GateVjp(T psi, T psi_grad) {
  return SigmoidVjp(psi, psi_grad);
}
// Adds to gate_grad.
template <class T>
PEPESEG_HD void GateAtVjp(const T* psi, const T* psi_grad, int count, T scale, T* gate_grad) {
  for (int k = 0; k < count; ++k) {
    const T bias_grad = GateVjp(psi[k], psi_grad[k]);
    gate_grad[k] = MulAdd(scale, bias_grad, gate_grad[k]);
    gate_grad[count + k] += bias_grad;
  }
}

}  // namespace pepeseg
