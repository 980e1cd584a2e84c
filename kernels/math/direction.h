#pragma once

#include "kernels/math/pair.h"

// Normalised features of the smoothing over neighbours (METHOD.md section 3, "Smoothing"). Vectors
// are `count` elements of T, as in pair.h.

namespace pepeseg {

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
