#pragma once

#include "kernels/math/hd.h"

// Constants and the step of front-to-back blending (Kerbl et al. 2023; METHOD.md section 1,
// "Rendering"). The forward and the backward pass share them and therefore make the same decisions
// (NUMERICS.md, "Bounds and rules"). Offsets dx, dy lead from a splat's mean to a pixel centre, in
// pixels.

namespace pepeseg {

inline constexpr int kTileSize = 16;                    // pixels a side
inline constexpr float kMaxAlpha = 0.99f;               // keeps the transmittance above 0
inline constexpr float kMinAlpha = 1.0f / 255.0f;       // fainter splats are skipped
inline constexpr float kMinTransmittance = 1e-4f;       // a pixel stops before it falls below
inline constexpr float kMinSquaredQuaternion = 1e-20f;  // Gaussians with a shorter one are culled

// 1 / (1 + exp(-x)), which turns a logit into an opacity.
template <class T>
PEPESEG_HD T Sigmoid(T x) {
  return T(1) / (T(1) + Exp(T(0) - x));
}
// Gradient of x, from that of `sigmoid`, the value.
template <class T>
PEPESEG_HD T SigmoidVjp(T sigmoid, T grad) {
  return grad * sigmoid * (T(1) - sigmoid);
}

// Powers are of 2: the value of a Gaussian at an offset from its mean is Exp2(Power(...)).
//
// The smallest power at which a splat of this opacity reaches kMinAlpha: -log2(255 o). The power is
// compared with it, in place of alpha with kMinAlpha, so that skipped splats need no exponential.
template <class T>
PEPESEG_HD T MinPower(T opacity) {
  return T(0) - Log2(opacity * T(1.0f / kMinAlpha));
}

// Triangular root of log2(e) / 2 times the conic, the inverse of the dilated covariance:
// power = -(xx dx + xy dy)^2 - (yy dy)^2. Compared with the sum of three products it is cheaper,
// never positive, and does not cancel for a long thin splat.
template <class T>
struct PowerRoot {
  T xx, xy, yy;
};
inline constexpr float kHalfLog2E = 0.72134752044448170f;  // log2(e) / 2
// `determinant` is that of the covariance, so conic_xx * determinant is the covariance's yy.
template <class T>
PEPESEG_HD PowerRoot<T> MakePowerRoot(T conic_xx, T conic_xy, T determinant) {
  const T xx = Sqrt(T(kHalfLog2E) * conic_xx);
  return {xx, T(kHalfLog2E) * conic_xy / xx, Sqrt(T(kHalfLog2E) / (conic_xx * determinant))};
}
// Standard deviation along the splat's longer axis, in pixels.
template <class T>
PEPESEG_HD T LongAxis(const PowerRoot<T>& root) {
  // With M = kHalfLog2E * conic it is the root of kHalfLog2E / (smaller eigenvalue of M), which is
  // kHalfLog2E * larger / det M. The root of det M is at hand: root.xx * root.yy.
  const T mid = T(0.5f) * (root.xx * root.xx + root.xy * root.xy + root.yy * root.yy);
  const T root_of_det = root.xx * root.yy;
  const T larger = mid + Sqrt(Max(T(0), (mid - root_of_det) * (mid + root_of_det)));
  return Sqrt(T(kHalfLog2E) * larger) / root_of_det;
}

// The parts of the power that a row of pixels shares: xy dy and -(yy dy)^2.
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

// Alpha of a splat at a pixel, where `gaussian` is its value there, in (0, 1].
template <class T>
PEPESEG_HD T Alpha(T opacity, T gaussian) {
  return Min(T(kMaxAlpha), opacity * gaussian);
}

// One step of blending. The splat counts with weight = alpha * transmittance, and the transmittance
// falls by the same amount.
template <class T>
struct Blended {
  T weight, transmittance;
};
template <class T>
PEPESEG_HD Blended<T> BlendStep(T alpha, T transmittance) {
  const T weight = alpha * transmittance;
#ifdef __CUDA_ARCH__
  // On a device the transmittance is a product of factors 1 - alpha to the last bit, because
  // render_backward.cu divides by the same factor, and rows.cu multiplies factors of
  // several splats before it applies them. The CPU keeps the transmittance of each step instead.
  return {weight, transmittance * (T(1) - alpha)};
#else
  return {weight, transmittance - weight};
#endif
}

// Gradient of alpha of one splat at one pixel. `transmittance` is that before the splat.
// `value_dot` is the dot product of the splat's colour (and depth) with the gradient of the pixel;
// `behind_dot` is that of everything behind the splat, as seen with
// transmittance 1. BehindStep takes `behind_dot` one splat further to the front, without a
// division.
template <class T>
PEPESEG_HD T AlphaVjp(T transmittance, T value_dot, T behind_dot) {
  return transmittance * (value_dot - behind_dot);
}
template <class T>
PEPESEG_HD T BehindStep(T alpha, T value_dot, T behind_dot) {
  return MulAdd(alpha, value_dot - behind_dot, behind_dot);
}
// Gradient of the logarithm of the Gaussian's value, from that of alpha: alpha = o G, so it is
// alpha times as large, and 0 where alpha is clamped to kMaxAlpha.
template <class T>
PEPESEG_HD T GaussianVjp(T alpha, T alpha_grad) {
  return Select(alpha < T(kMaxAlpha), alpha * alpha_grad, T(0));
}

// 1 / z, which is blended in place of the depth where the prior is a disparity.
template <class T>
PEPESEG_HD T InverseDepth(T z) {
  return T(1) / z;
}
// Gradient of z, from that of 1 / z.
template <class T>
PEPESEG_HD T InverseDepthVjp(T inverse_depth, T grad) {
  return T(0) - grad * inverse_depth * inverse_depth;
}

// Moments of GaussianVjp over the pixels of a splat: its sum, and its sums times dx, dy, dx^2, dx
// dy and dy^2. The gradients of the splat's shape and opacity need nothing else.
template <class T>
struct PowerMoments {
  T sum, x, y, xx, xy, yy;
};
template <class T>
struct SplatShapeGrad {
  T x, y, conic_xx, conic_xy, conic_yy, opacity;
};
// Gradients of mean, conic and opacity of a splat, from the moments. That of conic_xy counts both
// off-diagonal elements.
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
