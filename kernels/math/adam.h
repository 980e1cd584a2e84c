#pragma once

#include "kernels/math/hd.h"

namespace pepeseg {

// Constants of one step of Adam (Kingma & Ba 2015).
template <class T>
struct AdamRates {
  T beta1, beta2, epsilon;
  // Bias corrections at step t = 1, 2, ...: 1 / (1 - beta1^t) and 1 / sqrt(1 - beta2^t). Stage two
  // puts their quotient, c(t) of FeatureState, in the first and 1 in the second.
  T inv_correction1, inv_sqrt_correction2;
};

// Updates the moments of one parameter and returns the change to add to it. A `learning_rate` is in
// units of the parameter a step.
template <class T>
PEPESEG_HD T AdamStep(const AdamRates<T>& rates, T learning_rate, T grad, T& moment1, T& moment2) {
  moment1 = rates.beta1 * moment1 + (T(1) - rates.beta1) * grad;
  moment2 = rates.beta2 * moment2 + (T(1) - rates.beta2) * grad * grad;
  const T denominator = Sqrt(moment2) * rates.inv_sqrt_correction2 + rates.epsilon;
  return T(0) - learning_rate * rates.inv_correction1 * moment1 / denominator;
}

}  // namespace pepeseg
