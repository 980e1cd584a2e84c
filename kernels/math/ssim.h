#pragma once

#include "kernels/math/hd.h"

// Structural similarity (Wang et al. 2004) of one window, from its Gaussian-weighted moments.

namespace pepeseg {

// The 11 taps of a Gaussian of sigma 1.5, normalised: tap k is kSsimTaps[|k|].
inline constexpr int kSsimRadius = 5;
inline constexpr double kSsimTaps[kSsimRadius + 1] = {0.2660117248617943,   0.21300553771125366,
                                                      0.1093606895097,      0.03600077212843082,
                                                      0.007598758135239184, 0.0010283800844791099};
inline constexpr double kSsimC1 = 0.01 * 0.01;  // for a peak of 1
inline constexpr double kSsimC2 = 0.03 * 0.03;

// Only the sum of the two variances enters, so the squares of both images share a moment.
template <class T>
struct SsimMoments {
  T x, y;         // means
  T sum_squares;  // mean of x^2 + y^2
  T product;      // mean of x y
};

template <class T>
PEPESEG_HD T Ssim(const SsimMoments<T>& m) {
  const T means = m.x * m.y, squared_means = m.x * m.x + m.y * m.y;
  const T luminance = (T(2) * means + T(kSsimC1)) / (squared_means + T(kSsimC1));
  const T contrast =
      (T(2) * (m.product - means) + T(kSsimC2)) / (m.sum_squares - squared_means + T(kSsimC2));
  return luminance * contrast;
}

// Gradients of the moments that move with x.
template <class T>
struct SsimMomentsGrad {
  T x, sum_squares, product;
};
template <class T>
PEPESEG_HD SsimMomentsGrad<T> SsimVjp(const SsimMoments<T>& m, T grad) {
  const T means = m.x * m.y, squared_means = m.x * m.x + m.y * m.y;
  const T inv1 = T(1) / (squared_means + T(kSsimC1));
  const T inv2 = T(1) / (m.sum_squares - squared_means + T(kSsimC2));
  const T luminance = (T(2) * means + T(kSsimC1)) * inv1;
  const T contrast = (T(2) * (m.product - means) + T(kSsimC2)) * inv2;
  const T grad1 = grad * contrast * inv1, grad2 = grad * luminance * inv2;
  SsimMomentsGrad<T> out;
  out.x = T(2) * (grad1 * (m.y - luminance * m.x) + grad2 * (contrast * m.x - m.y));
  out.sum_squares = T(0) - grad2 * contrast;
  out.product = T(2) * grad2;
  return out;
}

// The gradient of a pixel x whose counterpart is y, from the moments' gradients gathered (with the
// taps) over the windows that hold it.
template <class T>
PEPESEG_HD T SsimPixelVjp(const SsimMomentsGrad<T>& gathered, T x, T y) {
  return gathered.x + T(2) * gathered.sum_squares * x + gathered.product * y;
}

}  // namespace pepeseg
