#pragma once

#include "kernels/math/hd.h"

// The constants and the step of front-to-back blending, the same forward and backward.

namespace pepeseg {

inline constexpr int kTileSize = 16;                    // pixels a side
inline constexpr float kMaxAlpha = 0.99f;               // so that transmittance never is 0
inline constexpr float kMinAlpha = 1.0f / 255.0f;       // fainter: skipped
inline constexpr float kMinTransmittance = 1e-4f;       // a pixel stops before it falls below
inline constexpr float kMinSquaredQuaternion = 1e-20f;  // shorter: degenerate

template <class T>
PEPESEG_HD T Sigmoid(T x) {
  return T(1) / (T(1) + Exp(T(0) - x));
}
template <class T>
PEPESEG_HD T SigmoidVjp(T sigmoid, T grad) {
  return grad * sigmoid * (T(1) - sigmoid);
}

// Powers are of 2: a Gaussian's value at an offset from its mean is Exp2(Power(...)).
//
// The smallest power at which a splat of this opacity still reaches kMinAlpha: -log2(255 o). It is
// tested in the place of alpha, before the exponential.
template <class T>
PEPESEG_HD T MinPower(T opacity) {
  return T(0) - Log2(opacity * T(1.0f / kMinAlpha));
}

// The triangular root of the conic: power = -(xx dx + xy dy)^2 - (yy dy)^2. Against the sum of
// three products it is cheaper, never positive, and loses nothing to cancellation on a long thin
// splat.
template <class T>
struct PowerRoot {
  T xx, xy, yy;
};
inline constexpr float kHalfLog2E = 0.72134752044448170f;  // log2(e) / 2
template <class T>
PEPESEG_HD PowerRoot<T> MakePowerRoot(T conic_xx, T conic_xy, T determinant) {
  const T xx = Sqrt(T(kHalfLog2E) * conic_xx);
  // `determinant` is the covariance's: conic_xx * determinant is its yy.
  return {xx, T(kHalfLog2E) * conic_xy / xx, Sqrt(T(kHalfLog2E) / (conic_xx * determinant))};
}
// The standard deviation along the splat's longer axis, pixels.
template <class T>
PEPESEG_HD T LongAxis(const PowerRoot<T>& root) {
  // From the larger eigenvalue of kHalfLog2E * conic over its determinant, which is a square.
  const T mid = T(0.5f) * (root.xx * root.xx + root.xy * root.xy + root.yy * root.yy);
  const T root_of_det = root.xx * root.yy;
  const T larger = mid + Sqrt(Max(T(0), (mid - root_of_det) * (mid + root_of_det)));
  return Sqrt(T(kHalfLog2E) * larger) / root_of_det;
}

// The parts of one row of pixels: xy dy and -(yy dy)^2.
template <class T>
struct PowerRow {
  T shift, drop;
};
template <class T>
PEPESEG_HD PowerRow<T> PowerAtRow(const PowerRoot<T>& root, T dy) {
  const T v = root.yy * dy;
  return {root.xy * dy, T(0) - v * v};
}
template <class T>
PEPESEG_HD T Power(T root_xx, const PowerRow<T>& row, T dx) {
  const T u = MulAdd(root_xx, dx, row.shift);
  return NegMulAdd(u, u, row.drop);
}

template <class T>
PEPESEG_HD T Alpha(T opacity, T gaussian) {
  return Min(T(kMaxAlpha), opacity * gaussian);
}

// A splat is seen with weight = alpha * transmittance, which is what the transmittance loses.
template <class T>
struct Blended {
  T weight, transmittance;
};
template <class T>
PEPESEG_HD Blended<T> BlendStep(T alpha, T transmittance) {
  const T weight = alpha * transmittance;
  return {weight, transmittance - weight};
}

// d loss / d alpha of one splat at one pixel. `value_dot` is the splat's colour (and depth) against
// the pixel's gradient; `behind_dot` the same of everything behind it, background included, as if
// seen with transmittance 1 - which is followed back to front by BehindStep, with no division.
template <class T>
PEPESEG_HD T AlphaVjp(T transmittance, T value_dot, T behind_dot) {
  return transmittance * (value_dot - behind_dot);
}
template <class T>
PEPESEG_HD T BehindStep(T alpha, T value_dot, T behind_dot) {
  return MulAdd(alpha, value_dot - behind_dot, behind_dot);
}
// d loss / d ln of the Gaussian: none where alpha is held at its maximum.
template <class T>
PEPESEG_HD T GaussianVjp(T alpha, T alpha_grad) {
  return Select(alpha < T(kMaxAlpha), alpha * alpha_grad, T(0));
}

// What is blended in the place of the depth where nearness is compared (a disparity).
template <class T>
PEPESEG_HD T InverseDepth(T z) {
  return T(1) / z;
}
template <class T>
PEPESEG_HD T InverseDepthVjp(T inverse_depth, T grad) {
  return T(0) - grad * inverse_depth * inverse_depth;
}

// Moments of d loss / d ln of the Gaussian over the pixels of a splat, offsets from its mean: all
// that its gradients need.
template <class T>
struct PowerMoments {
  T sum, x, y, xx, xy, yy;
};
template <class T>
struct SplatShapeGrad {
  T x, y, conic_xx, conic_xy, conic_yy, opacity;
};
template <class T>
PEPESEG_HD SplatShapeGrad<T> SplatShapeVjp(const PowerRoot<T>& root, T opacity,
                                           const PowerMoments<T>& m) {
  // ln of the Gaussian = -0.5 (conic_xx dx^2 + conic_yy dy^2) - conic_xy dx dy, dx = pixel - mean.
  const T scale = T(1.0f / kHalfLog2E);
  const T conic_xx = scale * root.xx * root.xx, conic_xy = scale * root.xx * root.xy;
  const T conic_yy = scale * (root.xy * root.xy + root.yy * root.yy);
  return {conic_xx * m.x + conic_xy * m.y,
          conic_xy * m.x + conic_yy * m.y,
          T(-0.5f) * m.xx,
          T(0) - m.xy,
          T(-0.5f) * m.yy,
          m.sum / opacity};
}

}  // namespace pepeseg
