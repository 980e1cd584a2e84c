#pragma once

#include "kernels/math/hd.h"

// Rendered depth x against a prior d that is known up to scale and shift (MiDaS alignment;
// METHOD.md section 1).

namespace pepeseg {

inline constexpr float kMinDepthPixels = 32;          // fewer do not carry a fit of the view
inline constexpr float kMinDepthSpread = 1e-3f;       // standard deviation of x, of its mean
inline constexpr float kWindowVarianceFloor = 1e-4f;  // of the view's variance of x

// What is seen is blended with weights that sum to alpha.
template <class T>
PEPESEG_HD T NormalizedDepth(T depth_sum, T alpha) {
  return depth_sum / alpha;
}
template <class T>
struct NormalizedDepthGrad {
  T depth_sum, alpha;
};
template <class T>
PEPESEG_HD NormalizedDepthGrad<T> NormalizedDepthVjp(T depth, T alpha, T grad) {
  const T sum_grad = grad / alpha;
  return {sum_grad, T(0) - sum_grad * depth};
}

// Sums over some pixels.
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
template <class T>
PEPESEG_HD T DepthVariance(const DepthMoments<T>& m) {
  const T each = T(1) / m.count, mean = each * m.x;
  return Max(T(0), each * m.xx - mean * mean);
}

// d is about scale x + shift.
template <class T>
struct ScaleShift {
  T scale, shift;
};
// The minimum of the mean of (scale x + shift - d)^2, plus variance_floor scale^2.
template <class T>
PEPESEG_HD ScaleShift<T> FitScaleShift(const DepthMoments<T>& m, T variance_floor) {
  const T each = T(1) / m.count, mean_x = each * m.x, mean_d = each * m.d;
  const T scale = (each * m.xd - mean_x * mean_d) / (DepthVariance(m) + variance_floor);
  return {scale, mean_d - scale * mean_x};
}
// A window in which the prior falls where x rises tells x nothing: its scale is 0.
template <class T>
PEPESEG_HD ScaleShift<T> FitWindow(const DepthMoments<T>& m, T variance_floor) {
  const ScaleShift<T> fit = FitScaleShift(m, variance_floor);
  const bool agrees = T(0) < fit.scale;
  return {Select(agrees, fit.scale, T(0)), Select(agrees, fit.shift, m.d / m.count)};
}

template <class T>
PEPESEG_HD T DepthResidual(const ScaleShift<T>& fit, T x, T d) {
  return fit.scale * x + (fit.shift - d);
}
// Of |residual| with respect to x; none through the fit.
template <class T>
PEPESEG_HD T AbsDepthResidualVjp(const ScaleShift<T>& fit, T residual, T grad) {
  return fit.scale * Select(T(0) < residual, grad, Select(residual < T(0), T(0) - grad, T(0)));
}

// Few pixels, next to no spread of x, or a scale of the wrong sign carry no fit.
template <class T>
PEPESEG_HD bool CarriesFit(const DepthMoments<T>& m) {
  if (m.count < T(kMinDepthPixels)) return false;
  const T mean = m.x / m.count, least = T(kMinDepthSpread) * mean;
  return least * least < DepthVariance(m) && T(0) < FitScaleShift(m, T(0)).scale;
}

// How the pixels of a view are compared.
struct DepthFit {
  ScaleShift<float> view, patch;
  float view_grad, local_grad;  // of |residual| at one pixel: weights over counts
  float variance_floor;         // of windows
  bool usable;                  // false: the view is skipped
};
// `patch` holds the moments of the patch, or those of the view where windows are fitted.
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

// One pixel under the fit of the view and a local one.
struct ComparedDepth {
  float view_error, local_error;
  float grad;  // of x
};
PEPESEG_HD ComparedDepth CompareDepth(const DepthFit& fit, const ScaleShift<float>& local,
                                      float local_grad, float x, float d) {
  const float of_view = DepthResidual(fit.view, x, d), of_local = DepthResidual(local, x, d);
  return {Abs(of_view), local_grad > 0 ? Abs(of_local) : 0.0f,
          AbsDepthResidualVjp(fit.view, of_view, fit.view_grad) +
              AbsDepthResidualVjp(local, of_local, local_grad)};
}

}  // namespace pepeseg
