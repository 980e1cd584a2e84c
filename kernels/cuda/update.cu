#include <cuda_runtime.h>

#include <cmath>

#include "kernels/cuda/cuda_backend.h"
#include "kernels/cuda/gaussian_vjp.cuh"
#include "kernels/cuda/launch.h"
#include "kernels/math/adam.h"

namespace pepeseg {
namespace {

constexpr int kBlock = 128;

struct UpdateParams {
  DevicePlanes<float> gaussians, moment1, moment2;
  int64_t count;
  int num_coefficients;  // stored
  ProjectionCamera<float> camera;
  int width, height;
  LearningRates rates;
  float beta1, beta2, epsilon;
  float log_beta1, log_beta2;
  float min_log_scale, max_log_scale;
  bool bounds_scale;
  const int32_t* gaussian_visible;
  const Splat* visible_splat;
  const SplatGrad* visible_grad;
  Room room;
  int32_t* num_steps;
  float* mean2d_grad_sum;  // these three may be null
  int32_t* num_visible;
  float* max_radius;
  int64_t* num_skipped;
};

__device__ float RateOf(const LearningRates& rates, int plane) {
  if (plane < kLogScalePlane) return rates.mean;
  if (plane < kRotationPlane) return rates.log_scale;
  if (plane < kOpacityPlane) return rates.rotation;
  if (plane < kShPlane) return rates.opacity;
  return plane < kShPlane + 3 ? rates.sh_dc : rates.sh_rest;
}

__device__ AdamRates<float> RatesAt(const UpdateParams& p, int step) {
  // 1 - beta^t without cancellation at the first steps.
  const float correction1 = -expm1f(static_cast<float>(step) * p.log_beta1);
  const float correction2 = -expm1f(static_cast<float>(step) * p.log_beta2);
  return {p.beta1, p.beta2, p.epsilon, 1 / correction1, rsqrtf(correction2)};
}

__device__ void AddStats(const UpdateParams& p, int64_t i, const Splat& splat,
                         const SplatGrad& grad) {
  if (p.mean2d_grad_sum != nullptr) {
    const float gx = grad.x * 0.5f * p.width, gy = grad.y * 0.5f * p.height;
    p.mean2d_grad_sum[i] += sqrtf(gx * gx + gy * gy);
  }
  if (p.num_visible != nullptr) ++p.num_visible[i];
  if (p.max_radius == nullptr) return;
  const PowerRoot<float> root = {splat.root_xx, splat.root_xy, splat.root_yy};
  p.max_radius[i] = max(p.max_radius[i], 3 * LongAxis(root));
}

__device__ void UpdateValue(const UpdateParams& p, const AdamRates<float>& rates, int plane,
                            int64_t i, float grad) {
  float m1 = p.moment1.At(plane, i), m2 = p.moment2.At(plane, i);
  float value = p.gaussians.At(plane, i);
  value += AdamStep(rates, RateOf(p.rates, plane), grad, m1, m2);
  if (plane >= kLogScalePlane && plane < kRotationPlane && p.bounds_scale) {
    value = min(max(value, p.min_log_scale), p.max_log_scale);
  }
  p.gaussians.At(plane, i) = value;
  p.moment1.At(plane, i) = m1;
  p.moment2.At(plane, i) = m2;
}

// Projection backward and Adam in one pass over the planes.
template <int kActiveDegree>
__global__ void __launch_bounds__(kBlock) UpdateKernel(UpdateParams p) {
  const int64_t i = int64_t{blockIdx.x} * kBlock + threadIdx.x;
  if (i >= p.count || p.room.IsVoid()) return;
  const int32_t visible = p.gaussian_visible[i];
  GaussianBackward vjp;
  ZeroGradient(vjp);
  if (visible >= 0) {
    const SplatGrad grad = p.visible_grad[visible];
    const DevicePlanes<const float> planes = {p.gaussians.data, p.gaussians.stride};
    BackwardGaussian<kActiveDegree>(planes, p.camera, i, grad, vjp);
    if (!vjp.IsUsable()) {
      atomicAdd(reinterpret_cast<unsigned long long*>(p.num_skipped), 1ull);
      return;
    }
    AddStats(p, i, ToSplat(LoadSplat(p.visible_splat, visible)), grad);
  }
  const int step = ++p.num_steps[i];
  const AdamRates<float> rates = RatesAt(p, step);
#pragma unroll
  for (int k = 0; k < kShPlane; ++k) UpdateValue(p, rates, k, i, vjp.shape[k]);
#pragma unroll
  for (int k = 0; k < NumShCoefficients(kMaxShDegree); ++k) {
    if (k >= p.num_coefficients) break;
#pragma unroll
    for (int c = 0; c < 3; ++c) {
      UpdateValue(p, rates, kShPlane + 3 * k + c, i, vjp.basis[k] * vjp.color[c]);
    }
  }
}

void LaunchUpdate(const UpdateParams& p, int active_degree, cudaStream_t stream) {
  const int num_blocks = NumBlocks(p.count, kBlock);
  switch (active_degree) {
    case 0: return UpdateKernel<0><<<num_blocks, kBlock, 0, stream>>>(p);
    case 1: return UpdateKernel<1><<<num_blocks, kBlock, 0, stream>>>(p);
    case 2: return UpdateKernel<2><<<num_blocks, kBlock, 0, stream>>>(p);
    default: return UpdateKernel<3><<<num_blocks, kBlock, 0, stream>>>(p);
  }
}

}  // namespace

void CudaBackend::Update(const UpdateArgs& args) {
  const Turn turn(*this);
  if (!turn || args.gaussians.count == 0) return;
  RenderScratch& scratch = *args.scratch;
  int64_t* num_skipped = scratch.counters.span().data + kNumSkippedGradientRows;
  Zero(num_skipped, sizeof(int64_t));
  LaunchUpdate({ToDevice(args.gaussians),
                ToDevice(args.moment1),
                ToDevice(args.moment2),
                args.gaussians.count,
                NumShCoefficients(args.gaussians.sh_degree),
                MakeProjectionCamera<float>(args.view),
                args.view.width,
                args.view.height,
                args.learning_rates,
                args.beta1,
                args.beta2,
                args.epsilon,
                static_cast<float>(std::log(static_cast<double>(args.beta1))),
                static_cast<float>(std::log(static_cast<double>(args.beta2))),
                args.min_log_scale,
                args.max_log_scale,
                args.max_log_scale > args.min_log_scale,
                scratch.cuda.gaussian_visible.span().data,
                scratch.visible_splat.span().data,
                scratch.visible_grad.span().data,
                RoomOf(scratch),
                args.num_steps.data,
                args.stats.mean2d_grad_sum.data,
                args.stats.num_visible.data,
                args.stats.max_radius.data,
                num_skipped},
               args.active_sh_degree, stream_);
  Launched("update");
}

}  // namespace pepeseg
