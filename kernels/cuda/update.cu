#include <cuda_runtime.h>

#include <cmath>

#include "kernels/cuda/cuda_backend.h"
#include "kernels/cuda/device_planes.cuh"
#include "kernels/math/adam.h"
#include "kernels/math/blend.h"
#include "kernels/math/dropout.h"

// Update (UpdateArgs in kernels/ops/render.h; METHOD.md section 1): the backward pass of the
// projection (project.cu) and steps of Adam (kernels/math/adam.h) in one pass over the planes of
// the Gaussians, so that gradients are never written to global memory.
//
// One thread per Gaussian, visible or not. For each step it puts the gradients into its own
// column of shared memory (StepGradients), and then goes through the planes in groups of
// kPlanesAtOnce, which it loads and stores once for all steps. Threads share nothing and need no
// barrier. The counter of skipped Gaussians is an integer atomic. Results are the same in every
// run, given visible_grad.

namespace pepeseg {
namespace {

// Small, so that the gradients of kMaxUpdateSteps steps fit the 64 KiB of shared memory that every
// supported device has.
constexpr int kBlock = 64;

// Inputs of one step.
struct StepParams {
  ProjectionCamera<float> camera;
  int width, height;
  float opacity_factor;  // of Render, see kernels/math/dropout.h
  const int32_t* gaussian_visible;
  const Splat* visible_splat;
  const SplatGrad* visible_grad;
  Room room;             // of a render that may have overflowed
  int64_t* num_skipped;  // counter of Gaussians with a gradient that is not finite
};

struct UpdateParams {
  StepParams steps[kMaxUpdateSteps];
  int num_updates;  // steps in use
  DevicePlanes<float> gaussians, moment1, moment2;
  int64_t count;
  int num_planes;                        // planes up to the active SH degree
  float rates[NumPlanes(kMaxShDegree)];  // learning rate of each plane
  float beta1, beta2, epsilon;
  float log_beta1, log_beta2;  // natural logarithms
  float min_log_scale, max_log_scale;
  bool bounds_scale;
  int32_t* num_steps;
  float *mean2d_grad_sum, *square_sum;  // these four (DensityStats) may be null
  int32_t* num_visible;
  float* max_radius;
};

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
__device__ void BackwardGaussian(const DevicePlanes<const float>& planes,
                                 const ProjectionCamera<float>& camera, int64_t i,
                                 float opacity_factor, const SplatGrad& grad,
                                 GaussianBackward& out) {
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
                                    SigmoidVjp(opacity, opacity_factor * grad.opacity)};
#pragma unroll
  for (int k = 0; k < kShPlane; ++k) out.shape[k] = in_order[k];
}

// For Gaussians that are not visible.
__device__ void ZeroGradient(GaussianBackward& out) {
#pragma unroll
  for (float& value : out.shape) value = 0;
#pragma unroll
  for (float& value : out.basis) value = 0;
#pragma unroll
  for (float& value : out.color) value = 0;
}

float RateOf(const LearningRates& rates, int plane) {
  if (plane < kLogScalePlane) return rates.mean;
  if (plane < kRotationPlane) return rates.log_scale;
  if (plane < kOpacityPlane) return rates.rotation;
  if (plane < kShPlane) return rates.opacity;
  return plane < kShPlane + 3 ? rates.sh_dc : rates.sh_rest;
}

// Adds to the statistics of a visible Gaussian. The gradient of the mean is scaled to NDC units.
__device__ void AddStats(const UpdateParams& p, const StepParams& step, int64_t i,
                         const Splat& splat, const SplatGrad& grad) {
  if (p.mean2d_grad_sum != nullptr) {
    const float gx = grad.x * 0.5f * step.width, gy = grad.y * 0.5f * step.height;
    p.mean2d_grad_sum[i] += sqrtf(gx * gx + gy * gy);
  }
  if (p.square_sum != nullptr) p.square_sum[i] += grad.squares;
  if (p.num_visible != nullptr) ++p.num_visible[i];
  if (p.max_radius == nullptr) return;
  const PowerRoot<float> root = {splat.root_xx, splat.root_xy, splat.root_yy};
  p.max_radius[i] = max(p.max_radius[i], 3 * LongAxis(root));
}

// Gradients of a block's Gaussians in one step, in shared memory while the planes stream by. Each
// thread reads back only what it wrote. Indexed memory lets the loop over the planes stay a loop:
// in registers it would have to be unrolled into a copy of its body for each plane.
struct StepGradients {
  float shape[kShPlane][kBlock];
  float basis[NumShCoefficients(kMaxShDegree)][kBlock];
  float color[3][kBlock];
  // Bias corrections of the step: 1 / (1 - beta1^t) and 1 / sqrt(1 - beta2^t). 0: the Gaussian does
  // not take part in the step.
  float inv_correction1[kBlock], inv_sqrt_correction2[kBlock];
};

// Stores the gradients of this thread's Gaussian.
__device__ void Store(const GaussianBackward& vjp, StepGradients& out) {
#pragma unroll
  for (int k = 0; k < kShPlane; ++k) out.shape[k][threadIdx.x] = vjp.shape[k];
#pragma unroll
  for (int k = 0; k < NumShCoefficients(kMaxShDegree); ++k) {
    out.basis[k][threadIdx.x] = vjp.basis[k];
  }
#pragma unroll
  for (int c = 0; c < 3; ++c) out.color[c][threadIdx.x] = vjp.color[c];
}

__device__ float GradientOf(const StepGradients& gradients, int plane) {
  if (plane < kShPlane) return gradients.shape[plane][threadIdx.x];
  const int k = (plane - kShPlane) / 3, c = (plane - kShPlane) % 3;
  return gradients.basis[k][threadIdx.x] * gradients.color[c][threadIdx.x];
}

// Adam on kPlanesAtOnce planes from `first` on, all steps. All loads come before the first store:
// the compiler must assume that a store changes what the next load reads, and many loads have to be
// in flight to hide the latency of memory.
constexpr int kPlanesAtOnce = 8;
__device__ void UpdatePlanes(const UpdateParams& p, const StepGradients* gradients, int first,
                             int64_t i) {
  float value[kPlanesAtOnce], moment1[kPlanesAtOnce], moment2[kPlanesAtOnce];
#pragma unroll
  for (int k = 0; k < kPlanesAtOnce; ++k) {
    if (first + k >= p.num_planes) break;
    value[k] = p.gaussians.At(first + k, i);
    moment1[k] = p.moment1.At(first + k, i);
    moment2[k] = p.moment2.At(first + k, i);
  }
#pragma unroll 1
  for (int step = 0; step < p.num_updates; ++step) {
    const StepGradients& its = gradients[step];
    const AdamRates<float> rates = {p.beta1, p.beta2, p.epsilon, its.inv_correction1[threadIdx.x],
                                    its.inv_sqrt_correction2[threadIdx.x]};
    if (rates.inv_correction1 == 0) continue;
#pragma unroll
    for (int k = 0; k < kPlanesAtOnce; ++k) {
      const int plane = first + k;
      if (plane >= p.num_planes) break;
      value[k] += AdamStep(rates, p.rates[plane], GradientOf(its, plane), moment1[k], moment2[k]);
      if (plane >= kLogScalePlane && plane < kRotationPlane && p.bounds_scale) {
        value[k] = min(max(value[k], p.min_log_scale), p.max_log_scale);
      }
    }
  }
#pragma unroll
  for (int k = 0; k < kPlanesAtOnce; ++k) {
    const int plane = first + k;
    if (plane >= p.num_planes) break;
    p.gaussians.At(plane, i) = value[k];
    p.moment1.At(plane, i) = moment1[k];
    p.moment2.At(plane, i) = moment2[k];
  }
}

// Stores the gradients of Gaussian i in one step and adds to its statistics. Returns whether the
// Gaussian takes part in the step: not after an overflowed render, and not where its gradient is
// not finite, which is counted. One that is not visible has the gradient 0.
template <int kActiveDegree>
__device__ bool StoreGradient(const UpdateParams& p, const StepParams& step, int64_t i,
                              StepGradients& out) {
  if (step.room.IsVoid()) return false;
  const int32_t visible = step.gaussian_visible[i];
  GaussianBackward vjp;
  ZeroGradient(vjp);
  if (visible >= 0) {
    const SplatGrad grad = step.visible_grad[visible];
    const DevicePlanes<const float> planes = {p.gaussians.data, p.gaussians.stride};
    BackwardGaussian<kActiveDegree>(planes, step.camera, i, step.opacity_factor, grad, vjp);
    if (!vjp.IsUsable()) {
      atomicAdd(reinterpret_cast<unsigned long long*>(step.num_skipped), 1ull);
      return false;
    }
    AddStats(p, step, i, ToSplat(LoadSplat(step.visible_splat, visible)), grad);
  }
  Store(vjp, out);
  return true;
}

// A Gaussian that does not take part in a step keeps its parameters, moments and count. One that is
// not visible takes part, and moves by its moments.
template <int kActiveDegree>
__global__ void __launch_bounds__(kBlock, 10) UpdateKernel(const __grid_constant__ UpdateParams p) {
  extern __shared__ char shared[];
  StepGradients* gradients = reinterpret_cast<StepGradients*>(shared);
  const int64_t i = int64_t{blockIdx.x} * kBlock + threadIdx.x;
  if (i >= p.count) return;
  int num_steps = p.num_steps[i];
  bool moves = false;
#pragma unroll 1
  for (int k = 0; k < p.num_updates; ++k) {
    StepGradients& its = gradients[k];
    its.inv_correction1[threadIdx.x] = 0;
    if (!StoreGradient<kActiveDegree>(p, p.steps[k], i, its)) continue;
    moves = true;
    ++num_steps;
    // 1 - beta^t as -expm1(t ln beta), which does not cancel at the first steps.
    its.inv_correction1[threadIdx.x] = 1 / -expm1f(static_cast<float>(num_steps) * p.log_beta1);
    its.inv_sqrt_correction2[threadIdx.x] =
        rsqrtf(-expm1f(static_cast<float>(num_steps) * p.log_beta2));
  }
  if (!moves) return;
  p.num_steps[i] = num_steps;
#pragma unroll 1
  for (int first = 0; first < p.num_planes; first += kPlanesAtOnce) {
    UpdatePlanes(p, gradients, first, i);
  }
}

// Shared memory beyond 48 KiB, for more than six steps, has to be asked for.
template <int kActiveDegree>
cudaError_t Launch(const UpdateParams& p, cudaStream_t stream) {
  const int bytes = p.num_updates * static_cast<int>(sizeof(StepGradients));
  const cudaError_t error = cudaFuncSetAttribute(
      UpdateKernel<kActiveDegree>, cudaFuncAttributeMaxDynamicSharedMemorySize, bytes);
  if (error != cudaSuccess) return error;
  UpdateKernel<kActiveDegree><<<NumBlocks(p.count, kBlock), kBlock, bytes, stream>>>(p);
  return cudaSuccess;
}

cudaError_t LaunchUpdate(const UpdateParams& p, int active_degree, cudaStream_t stream) {
  switch (active_degree) {
    case 0:
      return Launch<0>(p, stream);
    case 1:
      return Launch<1>(p, stream);
    case 2:
      return Launch<2>(p, stream);
    default:
      return Launch<3>(p, stream);
  }
}

StepParams ParamsOf(const UpdateStep& step) {
  RenderScratch& scratch = *step.scratch;
  return {MakeProjectionCamera<float>(step.view),
          step.view.width,
          step.view.height,
          OpacityFactor(step.dropout.share),
          scratch.cuda.gaussian_visible.span().data,
          scratch.visible_splat.span().data,
          scratch.visible_grad.span().data,
          RoomOf(scratch),
          scratch.counters.span().data + kNumSkippedGradientRows};
}

}  // namespace

void CudaBackend::Update(const UpdateArgs& args) {
  const Turn turn(*this);
  if (!turn || args.gaussians.count == 0) return;
  UpdateParams params = {{},
                         static_cast<int>(args.steps.size()),
                         ToDevice(args.gaussians),
                         ToDevice(args.moment1),
                         ToDevice(args.moment2),
                         args.gaussians.count,
                         NumPlanes(args.active_sh_degree),
                         {},
                         args.beta1,
                         args.beta2,
                         args.epsilon,
                         static_cast<float>(std::log(static_cast<double>(args.beta1))),
                         static_cast<float>(std::log(static_cast<double>(args.beta2))),
                         args.min_log_scale,
                         args.max_log_scale,
                         args.max_log_scale > args.min_log_scale,
                         args.num_steps.data,
                         args.stats.mean2d_grad_sum.data,
                         args.stats.square_sum.data,
                         args.stats.num_visible.data,
                         args.stats.max_radius.data};
  for (size_t k = 0; k < args.steps.size(); ++k) {
    params.steps[k] = ParamsOf(args.steps[k]);
    Zero(params.steps[k].num_skipped, sizeof(int64_t));
  }
  for (int k = 0; k < NumPlanes(args.active_sh_degree); ++k) {
    params.rates[k] = RateOf(args.learning_rates, k);
  }
  Keep(LaunchUpdate(params, args.active_sh_degree, stream_), "update");
  Launched("update");
}

}  // namespace pepeseg
