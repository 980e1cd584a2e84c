#pragma once

#include "kernels/math/blend.h"
#include "kernels/math/projection.h"
#include "kernels/math/sh.h"
#include "kernels/ops.h"

namespace pepeseg {

// The gradient of all the parameters of one Gaussian, in the order of the planes.
struct GaussianGrad {
  float value[NumPlanes(kMaxShDegree)];
};

inline GaussianShape<float> LoadShape(const ConstGaussianPlanes& planes, int64_t i) {
  const auto at = [&](int plane) { return planes.Plane(plane)[i]; };
  return {
      {at(kMeanPlane), at(kMeanPlane + 1), at(kMeanPlane + 2)},
      {at(kLogScalePlane), at(kLogScalePlane + 1), at(kLogScalePlane + 2)},
      {at(kRotationPlane), at(kRotationPlane + 1), at(kRotationPlane + 2), at(kRotationPlane + 3)}};
}

// Projection, colour and opacity backward for one visible Gaussian. Coefficients beyond the active
// degree get 0.
inline GaussianGrad ProjectGaussianVjp(const ConstGaussianPlanes& planes,
                                       const ProjectionCamera<float>& camera, int active_sh_degree,
                                       int64_t i, const SplatGrad& grad) {
  GaussianGrad out = {};
  const GaussianShape<float> shape = LoadShape(planes, i);
  const ProjectionGrad<float> projection_grad = {
      grad.x, grad.y, {grad.conic_xx, grad.conic_xy, grad.conic_yy}, grad.depth};
  GaussianShape<float> g = ProjectVjp(camera, shape, projection_grad);

  const Vec3<float> offset = shape.mean - CameraCenter(camera);
  const Vec3<float> dir = Normalize(offset);
  const int num_coefficients = NumShCoefficients(active_sh_degree);
  float basis[16], basis_grad[16] = {};
  ShBasis(dir, active_sh_degree, basis);
  const float color_grad[3] = {grad.r, grad.g, grad.b};
  for (int c = 0; c < 3; ++c) {
    float sum = 0;
    for (int k = 0; k < num_coefficients; ++k) {
      sum += basis[k] * planes.Plane(kShPlane + 3 * k + c)[i];
    }
    const float sum_grad = ShChannelVjp(sum, color_grad[c]);
    for (int k = 0; k < num_coefficients; ++k) {
      basis_grad[k] += planes.Plane(kShPlane + 3 * k + c)[i] * sum_grad;
      out.value[kShPlane + 3 * k + c] = basis[k] * sum_grad;
    }
  }
  g.mean = g.mean + NormalizeVjp(offset, ShBasisVjp(dir, active_sh_degree, basis_grad));

  const float shape_grad[] = {g.mean.x,      g.mean.y,      g.mean.z,     g.log_scale.x,
                              g.log_scale.y, g.log_scale.z, g.rotation.w, g.rotation.x,
                              g.rotation.y,  g.rotation.z};
  for (int k = 0; k < kOpacityPlane; ++k) out.value[k] = shape_grad[k];
  out.value[kOpacityPlane] = SigmoidVjp(Sigmoid(planes.Plane(kOpacityPlane)[i]), grad.opacity);
  return out;
}

}  // namespace pepeseg
