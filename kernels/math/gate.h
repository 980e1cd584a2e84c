#pragma once

#include "kernels/math/blend.h"

namespace pepeseg {

// psi(s) = sigmoid(W s + b), one channel of it.
template <class T>
PEPESEG_HD T Gate(T weight, T bias, T scale) {
  return Sigmoid(MulAdd(weight, scale, bias));
}
// The gradient of the bias; that of the weight is `scale` times it.
template <class T>
PEPESEG_HD T GateVjp(T psi, T psi_grad) {
  return SigmoidVjp(psi, psi_grad);
}

}  // namespace pepeseg
