#pragma once

#include "kernels/math/hd.h"

// The scale-aware contrastive loss. Feature vectors are `count` elements of T: 32 numbers, or fewer
// vectors of lanes. Total(x) adds the lanes of a T and is the number itself for a number.

namespace pepeseg {

PEPESEG_HD float Total(float x) { return x; }
PEPESEG_HD double Total(double x) { return x; }

// Added to squared norms, so that a pixel on which nothing was blended has a direction of length 0.
inline constexpr float kSquaredNormFloor = 1e-12f;

// unit = psi * f / |psi * f|; returns 1 / |psi * f|.
template <class T>
PEPESEG_HD T GatedUnit(const T* psi, const T* feature, int count, T* unit) {
  T squares = T(0);
  for (int k = 0; k < count; ++k) {
    unit[k] = psi[k] * feature[k];
    squares = MulAdd(unit[k], unit[k], squares);
  }
  const T inv_norm = T(1) / Sqrt(Total(squares) + T(kSquaredNormFloor));
  for (int k = 0; k < count; ++k) unit[k] = unit[k] * inv_norm;
  return inv_norm;
}
// Adds to feature_grad and psi_grad.
template <class T>
PEPESEG_HD void GatedUnitVjp(const T* psi, const T* feature, int count, const T* unit_grad,
                             T* feature_grad, T* psi_grad) {
  T squares = T(0), along = T(0);
  for (int k = 0; k < count; ++k) {
    const T gated = psi[k] * feature[k];
    squares = MulAdd(gated, gated, squares);
    along = MulAdd(gated, unit_grad[k], along);
  }
  const T inv_norm = T(1) / Sqrt(Total(squares) + T(kSquaredNormFloor));
  const T pull = Total(along) * inv_norm * inv_norm;
  for (int k = 0; k < count; ++k) {
    const T gated_grad = inv_norm * (unit_grad[k] - pull * psi[k] * feature[k]);
    feature_grad[k] = MulAdd(psi[k], gated_grad, feature_grad[k]);
    psi_grad[k] = MulAdd(feature[k], gated_grad, psi_grad[k]);
  }
}

// -w C where the labels agree, w max(C, 0) where they do not.
template <class T>
PEPESEG_HD T PositiveTerm(T weight, T cosine) {
  return T(0) - weight * cosine;
}
template <class T>
PEPESEG_HD T PositiveTermVjp(T weight) {
  return T(0) - weight;
}
template <class T>
PEPESEG_HD T NegativeTerm(T weight, T cosine) {
  return weight * Max(cosine, T(0));
}
template <class T>
PEPESEG_HD T NegativeTermVjp(T weight, T cosine) {
  return Select(T(0) < cosine, weight, T(0));
}

// (|f| - 1)^2.
template <class T>
PEPESEG_HD T NormTerm(const T* feature, int count) {
  T squares = T(0);
  for (int k = 0; k < count; ++k) squares = MulAdd(feature[k], feature[k], squares);
  const T excess = Sqrt(Total(squares) + T(kSquaredNormFloor)) - T(1);
  return excess * excess;
}
// The gradient is this times f.
template <class T>
PEPESEG_HD T NormTermVjp(const T* feature, int count, T grad) {
  T squares = T(0);
  for (int k = 0; k < count; ++k) squares = MulAdd(feature[k], feature[k], squares);
  return T(2) * grad * (T(1) - T(1) / Sqrt(Total(squares) + T(kSquaredNormFloor)));
}

}  // namespace pepeseg
