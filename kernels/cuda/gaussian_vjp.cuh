#pragma once

#include "kernels/cuda/device_planes.cuh"
#include "kernels/math/blend.h"

// From the gradient of a splat to those of the parameters of its Gaussian: the backward pass of
// project.cu, shared by project_backward.cu and update.cu.

namespace pepeseg {

// Gradients of all parameters of one Gaussian. Those of the SH coefficients are kept as their
// factors: the gradient of coefficient k of channel c is basis[k] * color[c].
struct GaussianBackward {
  float shape[kShPlane];                         // mean to opacity, in the order of the planes
  float basis[NumShCoefficients(kMaxShDegree)];  // 0 beyond the active degree
  float color[3];

  // Returns whether all gradients are finite and below 1e30.
  __device__ bool IsUsable() const {
    bool usable = true;
#pragma unroll
    for (float value : shape) usable &= pepeseg::IsUsable(value);
#pragma unroll
    for (float b : basis) {
      for (float c : color) usable &= pepeseg::IsUsable(b * c);
    }
    return usable;
  }
};

// Writes the gradients of visible Gaussian i, through projection, colour and opacity. It projects
// and shades again: nothing but the splat's gradient is kept from the forward pass.
template <int kActiveDegree>
__device__ inline void BackwardGaussian(const DevicePlanes<const float>& planes,
                                        const ProjectionCamera<float>& camera, int64_t i,
                                        const SplatGrad& grad, GaussianBackward& out) {
  constexpr int kNumCoefficients = NumShCoefficients(kActiveDegree);
  const GaussianShape<float> shape = LoadShape(planes, i);
  const Vec3<float> offset = shape.mean - CameraCenter(camera);
  const Vec3<float> dir = Normalize(offset);
  ShBasis(dir, kActiveDegree, out.basis);
#pragma unroll
  for (int k = kNumCoefficients; k < NumShCoefficients(kMaxShDegree); ++k) out.basis[k] = 0;
  const float color_grad[3] = {grad.r, grad.g, grad.b};
  float basis_grad[kNumCoefficients] = {};
#pragma unroll
  for (int c = 0; c < 3; ++c) {
    float coefficient[kNumCoefficients], sum = 0;
#pragma unroll
    for (int k = 0; k < kNumCoefficients; ++k) {
      coefficient[k] = planes.At(kShPlane + 3 * k + c, i);
      sum += out.basis[k] * coefficient[k];
    }
    out.color[c] = ShChannelVjp(sum, color_grad[c]);
#pragma unroll
    for (int k = 0; k < kNumCoefficients; ++k) basis_grad[k] += coefficient[k] * out.color[c];
  }
  const ProjectionGrad<float> projection_grad = {
      grad.x, grad.y, {grad.conic_xx, grad.conic_xy, grad.conic_yy}, grad.depth};
  GaussianShape<float> g = ProjectVjp(camera, shape, projection_grad);
  g.mean = g.mean + NormalizeVjp(offset, ShBasisVjp(dir, kActiveDegree, basis_grad));
  const float opacity = Sigmoid(planes.At(kOpacityPlane, i));
  const float in_order[kShPlane] = {g.mean.x,
                                    g.mean.y,
                                    g.mean.z,
                                    g.log_scale.x,
                                    g.log_scale.y,
                                    g.log_scale.z,
                                    g.rotation.w,
                                    g.rotation.x,
                                    g.rotation.y,
                                    g.rotation.z,
                                    SigmoidVjp(opacity, grad.opacity)};
#pragma unroll
  for (int k = 0; k < kShPlane; ++k) out.shape[k] = in_order[k];
}

// For Gaussians that are not visible.
__device__ inline void ZeroGradient(GaussianBackward& out) {
#pragma unroll
  for (float& value : out.shape) value = 0;
#pragma unroll
  for (float& value : out.basis) value = 0;
#pragma unroll
  for (float& value : out.color) value = 0;
}

}  // namespace pepeseg
