#pragma once

#include "kernels/math/hd.h"

// Comparison of rendered depth x with a prior d that is known up to scale and shift (alignment as
// in MiDaS, Ranftl et al.; METHOD.md section 1, "Depth"). x is in scene units, or their inverse for
// a disparity; d is in units of its own. The argument structs are in kernels/ops/render.h.

namespace pepeseg {

inline constexpr float kMinDepthPixels = 32;     // fewer pixels do not carry a fit
inline constexpr float kMinDepthSpread = 1e-3f;  // least standard deviation of x, as a share of its
                                                 // mean
inline constexpr float kWindowVarianceFloor = 1e-4f;  // share of the view's variance of x

// Depth of a pixel, from the sum of weight * depth over its Gaussians and the sum `alpha` of the
// weights. alpha must be above 0.
template <class T>
PEPESEG_HD T NormalizedDepth(T depth_sum, T alpha) {
  return depth_sum / alpha;
}
template <class T>
struct NormalizedDepthGrad {
  T depth_sum, alpha;
};
// Gradients of depth_sum and alpha, from the gradient of `depth`, which is their quotient.
template <class T>
PEPESEG_HD NormalizedDepthGrad<T> NormalizedDepthVjp(T depth, T alpha, T grad) {
  const T sum_grad = grad / alpha;
  return {sum_grad, T(0) - sum_grad * depth};
}

// Sums over a set of pixels: all that a fit needs. Summed in double, as variances cancel.
template <class T>
struct DepthMoments {
  T count, x, d, xx, xd;
};
template <class T>
PEPESEG_HD DepthMoments<T> DepthMomentsOf(T x, T d) {
  return {T(1), x, d, x * x, x * d};
}
template <class T>
PEPESEG_HD DepthMoments<T> operator+(const DepthMoments<T>& a, const DepthMoments<T>& b) {
  return {a.count + b.count, a.x + b.x, a.d + b.d, a.xx + b.xx, a.xd + b.xd};
}
template <class T>
PEPESEG_HD DepthMoments<T> operator-(const DepthMoments<T>& a, const DepthMoments<T>& b) {
  return {a.count - b.count, a.x - b.x, a.d - b.d, a.xx - b.xx, a.xd - b.xd};
}
// Variance of x over the pixels; rounding below 0 becomes 0. count must be above 0.
template <class T>
PEPESEG_HD T DepthVariance(const DepthMoments<T>& m) {
  const T each = T(1) / m.count, mean = each * m.x;
  return Max(T(0), each * m.xx - mean * mean);
}

// A fit: d is about scale * x + shift.
template <class T>
struct ScaleShift {
  T scale, shift;
};
// Returns the fit that minimises mean (scale x + shift - d)^2 + variance_floor scale^2. The floor,
// in units of x^2, keeps the scale small where x hardly varies.
template <class T>
PEPESEG_HD ScaleShift<T> FitScaleShift(const DepthMoments<T>& m, T variance_floor) {
  const T each = T(1) / m.count, mean_x = each * m.x, mean_d = each * m.d;
  const T scale = (each * m.xd - mean_x * mean_d) / (DepthVariance(m) + variance_floor);
  return {scale, mean_d - scale * mean_x};
}
// Fit of one window. Where the prior falls as x rises the window says nothing about x: its scale is
// 0, so that no gradient passes, and its shift the mean of d.
template <class T>
PEPESEG_HD ScaleShift<T> FitWindow(const DepthMoments<T>& m, T variance_floor) {
  const ScaleShift<T> fit = FitScaleShift(m, variance_floor);
  const bool agrees = T(0) < fit.scale;
  return {Select(agrees, fit.scale, T(0)), Select(agrees, fit.shift, m.d / m.count)};
}

// scale x + shift - d.
template <class T>
PEPESEG_HD T DepthResidual(const ScaleShift<T>& fit, T x, T d) {
  return fit.scale * x + (fit.shift - d);
}
// Gradient of x, from the gradient `grad` of |residual|. The fit counts as constant.
template <class T>
PEPESEG_HD T AbsDepthResidualVjp(const ScaleShift<T>& fit, T residual, T grad) {
  return fit.scale * Select(T(0) < residual, grad, Select(residual < T(0), T(0) - grad, T(0)));
}

// Returns whether the pixels determine a fit: enough of them, enough spread of x, a positive scale.
template <class T>
PEPESEG_HD bool CarriesFit(const DepthMoments<T>& m) {
  if (m.count < T(kMinDepthPixels)) return false;
  const T mean = m.x / m.count, least = T(kMinDepthSpread) * mean;
  return least * least < DepthVariance(m) && T(0) < FitScaleShift(m, T(0)).scale;
}

// How the pixels of a view are compared.
struct DepthFit {
  ScaleShift<float> view, patch;  // of the whole view, and of the rectangle of kPatch
  // d loss / d |residual| of one pixel: the weight over the number of pixels. local_grad is 0 where
  // there is no local fit.
  float view_grad, local_grad;
  float variance_floor;  // for FitWindow
  bool usable;           // false: the view carries no fit and is skipped
};
// `patch` holds the moments of the rectangle, or those of the view where windows are fitted.
PEPESEG_HD DepthFit FitDepth(const DepthMoments<double>& view, const DepthMoments<double>& patch,
                             float view_weight, float local_weight) {
  DepthFit fit = {};
  fit.usable = CarriesFit(view);
  if (!fit.usable) return fit;
  const ScaleShift<double> of_view = FitScaleShift(view, 0.0);
  fit.view = {static_cast<float>(of_view.scale), static_cast<float>(of_view.shift)};
  fit.view_grad = view_weight / static_cast<float>(view.count);
  fit.variance_floor = kWindowVarianceFloor * static_cast<float>(DepthVariance(view));
  if (!CarriesFit(patch)) return fit;
  const ScaleShift<double> of_patch = FitScaleShift(patch, 0.0);
  fit.patch = {static_cast<float>(of_patch.scale), static_cast<float>(of_patch.shift)};
  fit.local_grad = local_weight / static_cast<float>(patch.count);
  return fit;
}

// Errors of one pixel under the fit of the view and a local one, in units of d.
struct ComparedDepth {
  float view_error, local_error;
  float grad;  // d loss / d x
};
// local_grad is fit.local_grad, or 0 for a pixel outside the rectangle.
PEPESEG_HD ComparedDepth CompareDepth(const DepthFit& fit, const ScaleShift<float>& local,
                                      float local_grad, float x, float d) {
  const float of_view = DepthResidual(fit.view, x, d), of_local = DepthResidual(local, x, d);
  return {Abs(of_view), local_grad > 0 ? Abs(of_local) : 0.0f,
          AbsDepthResidualVjp(fit.view, of_view, fit.view_grad) +
              AbsDepthResidualVjp(local, of_local, local_grad)};
}

}  // namespace pepeseg
