#pragma once

#include "kernels/math/hd.h"

// Structural similarity (Wang et al. 2004; SSIM in METHOD.md section 1) of one window in one
// channel, from its Gaussian-weighted moments. Values of photographs lie in [0, 1]. SSIM lies in
// [-1, 1] and is 1 for equal windows.

namespace pepeseg {

// The window is the outer product of 11 taps, a Gaussian of sigma 1.5 pixels that sums to 1: tap k
// of -5..5 is kSsimTaps[|k|].
inline constexpr int kSsimRadius = 5;
inline constexpr double kSsimTaps[kSsimRadius + 1] = {0.2660117248617943,   0.21300553771125366,
                                                      0.1093606895097,      0.03600077212843082,
                                                      0.007598758135239184, 0.0010283800844791099};
inline constexpr double kSsimC1 = 0.01 * 0.01;  // C1 and C2 of the paper, for a peak value of 1
inline constexpr double kSsimC2 = 0.03 * 0.03;

// Weighted moments of a window in images x (rendered) and y (photograph). SSIM needs only the sum
// of the two variances, so the squares of both images share a moment.
template <class T>
struct SsimMoments {
  T x, y;         // means
  T sum_squares;  // mean of x^2 + y^2
  T product;      // mean of x y
};

// (2 mx my + C1) / (mx^2 + my^2 + C1) times (2 cov_xy + C2) / (var_x + var_y + C2).
template <class T>
PEPESEG_HD T Ssim(const SsimMoments<T>& m) {
  const T means = m.x * m.y, squared_means = m.x * m.x + m.y * m.y;
  const T luminance = (T(2) * means + T(kSsimC1)) / (squared_means + T(kSsimC1));
  const T contrast =
      (T(2) * (m.product - means) + T(kSsimC2)) / (m.sum_squares - squared_means + T(kSsimC2));
  return luminance * contrast;
}

// Gradients of the moments that depend on x; y is constant.
template <class T>
struct SsimMomentsGrad {
  T x, sum_squares, product;
};
// Gradients of the moments, from the gradient `grad` of SSIM.
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

// Gradient of a pixel x of the rendered image; y is the same pixel of the photograph. `gathered` is
// the sum of the moments' gradients over the windows that hold the pixel, weighted with the taps.
template <class T>
PEPESEG_HD T SsimPixelVjp(const SsimMomentsGrad<T>& gathered, T x, T y) {
  return gathered.x + T(2) * gathered.sum_squares * x + gathered.product * y;
}

}  // namespace pepeseg
