#pragma once

#include "kernels/math/hd.h"

// Formulas of stage two on feature vectors (METHOD.md section 3): terms of the losses ("Contrastive
// loss", "Norms"), and the directions that are smoothed over neighbours ("Smoothing"). Feature
// vectors are `count` elements of T: 32 numbers, or fewer vectors of lanes. Total(x) is the sum of
// the lanes of x, in every lane; for a number it is the number.

namespace pepeseg {

PEPESEG_HD float Total(float x) { return x; }
PEPESEG_HD double Total(double x) { return x; }

// Added to squared norms, so that a pixel on which nothing was blended gets the direction 0 and not
// NaN.
inline constexpr float kSquaredNormFloor = 1e-12f;

// Writes unit = psi * f / |psi * f|, with the elementwise product, and returns 1 / |psi * f|. The
// cosine C of two pixels is the dot product of their units.
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
// Adds the gradients of f and psi, from that of `unit`, to feature_grad and psi_grad.
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

// Terms of one pair: -w C where the labels agree, w max(C - margin, 0) where they do not. The Vjps
// are their derivatives with respect to C.
template <class T>
PEPESEG_HD T PositiveTerm(T weight, T cosine) {
  return T(0) - weight * cosine;
}
template <class T>
PEPESEG_HD T PositiveTermVjp(T weight) {
  return T(0) - weight;
}
template <class T>
PEPESEG_HD T NegativeTerm(T weight, T cosine, T margin) {
  return weight * Max(cosine - margin, T(0));
}
template <class T>
PEPESEG_HD T NegativeTermVjp(T weight, T cosine, T margin) {
  return Select(margin < cosine, weight, T(0));
}

// Norm term (|f| - 1)^2 of one vector.
template <class T>
PEPESEG_HD T NormTerm(const T* feature, int count) {
  T squares = T(0);
  for (int k = 0; k < count; ++k) squares = MulAdd(feature[k], feature[k], squares);
  const T excess = Sqrt(Total(squares) + T(kSquaredNormFloor)) - T(1);
  return excess * excess;
}
// Returns the factor of f in the gradient of f, from the gradient `grad` of the norm term.
template <class T>
PEPESEG_HD T NormTermVjp(const T* feature, int count, T grad) {
  T squares = T(0);
  for (int k = 0; k < count; ++k) squares = MulAdd(feature[k], feature[k], squares);
  return T(2) * grad * (T(1) - T(1) / Sqrt(Total(squares) + T(kSquaredNormFloor)));
}

// Writes direction = f / |f| and returns 1 / |f|, where |f|^2 is raised by kSquaredNormFloor: f = 0
// has the direction 0.
template <class T>
PEPESEG_HD T Direction(const T* feature, int count, T* direction) {
  T squares = T(0);
  for (int k = 0; k < count; ++k) squares = MulAdd(feature[k], feature[k], squares);
  const T inv_length = T(1) / Sqrt(Total(squares) + T(kSquaredNormFloor));
  for (int k = 0; k < count; ++k) direction[k] = feature[k] * inv_length;
  return inv_length;
}
// Turns `grad`, the gradient of the direction, into that of the feature, in place.
template <class T>
PEPESEG_HD void DirectionVjp(const T* direction, T inv_length, int count, T* grad) {
  T along = T(0);
  for (int k = 0; k < count; ++k) along = MulAdd(direction[k], grad[k], along);
  const T pull = Total(along);
  for (int k = 0; k < count; ++k) grad[k] = inv_length * (grad[k] - pull * direction[k]);
}

}  // namespace pepeseg
