#pragma once

#include "kernels/math/pair.h"

namespace pepeseg {

// direction = f / |f|, for vectors as of pair.h; returns 1 / |f|.
template <class T>
PEPESEG_HD T Direction(const T* feature, int count, T* direction) {
  T squares = T(0);
  for (int k = 0; k < count; ++k) squares = MulAdd(feature[k], feature[k], squares);
  const T inv_length = T(1) / Sqrt(Total(squares) + T(kSquaredNormFloor));
  for (int k = 0; k < count; ++k) direction[k] = feature[k] * inv_length;
  return inv_length;
}
// grad is that of the direction, and becomes that of the feature.
template <class T>
PEPESEG_HD void DirectionVjp(const T* direction, T inv_length, int count, T* grad) {
  T along = T(0);
  for (int k = 0; k < count; ++k) along = MulAdd(direction[k], grad[k], along);
  const T pull = Total(along);
  for (int k = 0; k < count; ++k) grad[k] = inv_length * (grad[k] - pull * direction[k]);
}

}  // namespace pepeseg
