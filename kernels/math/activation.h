#pragma once

#include "kernels/math/hd.h"

namespace pepeseg {

// Returns a / b, on a GPU to 2 ulp by the hardware's reciprocal; b is in [1, 2^126].
template <class T>
PEPESEG_HD T Quotient(T a, T b) {
  return a / b;
}
#ifdef __CUDA_ARCH__
PEPESEG_HD float Quotient(float a, float b) { return __fdividef(a, b); }
#endif

// Returns erf(x) to 3e-7: a rational function of x^2 times x, fitted on [-3.95, 3.95] for the least
// relative error (2e-8 in exact arithmetic). Beyond, erf is 1 within 3e-8. No branch and no
// exponential, so that it costs the same in vector lanes and on a GPU.
template <class T>
PEPESEG_HD T Erf(T x) {
  const T bound = T(3.95f);
  const T clamped = Max(Min(x, bound), T(0.0f) - bound);
  const T t = clamped * clamped;
  T above = MulAdd(T(2.0259624307e-6f), t, T(2.8468502569e-4f));
  above = MulAdd(above, t, T(3.8079691585e-3f));
  above = MulAdd(above, t, T(5.2874844521e-2f));
  above = MulAdd(above, t, T(1.9154559076e-1f));
  above = MulAdd(above, t, T(1.1283791065f));
  T below = MulAdd(T(3.7832232920e-5f), t, T(1.1706824880e-3f));
  below = MulAdd(below, t, T(1.5054698102e-2f));
  below = MulAdd(below, t, T(1.1455769092e-1f));
  below = MulAdd(below, t, T(5.0308555365e-1f));
  below = MulAdd(below, t, T(1.0f));
  return clamped * Quotient(above, below);
}

// Returns x / 2 (1 + erf(x / sqrt(2))) to 3e-7 of |x|.
template <class T>
PEPESEG_HD T Gelu(T x) {
  const T half = T(0.5f) * x;
  return MulAdd(half, Erf(x * T(0.70710678f)), half);
}

}  // namespace pepeseg
