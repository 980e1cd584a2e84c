#pragma once

#include "kernels/math/hd.h"

namespace pepeseg {

// One step of Adam (Kingma & Ba 2015).
template <class T>
struct AdamRates {
  T beta1, beta2, epsilon;
  // Bias corrections after t steps: 1 / (1 - beta1^t) and 1 / sqrt(1 - beta2^t).
  T inv_correction1, inv_sqrt_correction2;
};

// Returns the change of the parameter; the moments move.
template <class T>
PEPESEG_HD T AdamStep(const AdamRates<T>& rates, T learning_rate, T grad, T& moment1, T& moment2) {
  moment1 = rates.beta1 * moment1 + (T(1) - rates.beta1) * grad;
  moment2 = rates.beta2 * moment2 + (T(1) - rates.beta2) * grad * grad;
  const T denominator = Sqrt(moment2) * rates.inv_sqrt_correction2 + rates.epsilon;
  return T(0) - learning_rate * rates.inv_correction1 * moment1 / denominator;
}

}  // namespace pepeseg
