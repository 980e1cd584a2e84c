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

// The smallest power at which a splat of this opacity still reaches kMinAlpha: -ln(255 o). It is
// tested in the place of alpha, before the exp.
template <class T>
PEPESEG_HD T MinPower(T opacity) {
  return T(0) - Log(opacity * T(1.0f / kMinAlpha));
}

// ln of the Gaussian at (dx, dy) from its mean. Written as conic_xx (dx (dx / 2)) ... in this order
// so that all of a row's terms in dy are shared.
template <class T>
PEPESEG_HD T Power(T conic_xx, T conic_xy, T conic_yy, T dx, T dy) {
  return T(-0.5f) * (conic_xx * dx * dx + conic_yy * dy * dy) - conic_xy * dx * dy;
}

template <class T>
PEPESEG_HD T Alpha(T opacity, T gaussian) {
  return Min(T(kMaxAlpha), opacity * gaussian);
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
  return behind_dot + alpha * (value_dot - behind_dot);
}
// d loss / d power: none where alpha is held at its maximum.
template <class T>
PEPESEG_HD T PowerVjp(T alpha, T alpha_grad) {
  return Select(alpha < T(kMaxAlpha), alpha * alpha_grad, T(0));
}

// Moments of d loss / d power over the pixels of a splat, offsets from its mean: all that its
// gradients need.
template <class T>
struct PowerMoments {
  T sum, x, y, xx, xy, yy;
};
template <class T>
struct SplatShapeGrad {
  T x, y, conic_xx, conic_xy, conic_yy, opacity;
};
template <class T>
PEPESEG_HD SplatShapeGrad<T> SplatShapeVjp(T conic_xx, T conic_xy, T conic_yy, T opacity,
                                           const PowerMoments<T>& m) {
  // power = -0.5 (cxx dx^2 + cyy dy^2) - cxy dx dy with dx = pixel - mean.
  return {conic_xx * m.x + conic_xy * m.y,
          conic_xy * m.x + conic_yy * m.y,
          T(-0.5f) * m.xx,
          T(0) - m.xy,
          T(-0.5f) * m.yy,
          m.sum / opacity};
}

}  // namespace pepeseg
