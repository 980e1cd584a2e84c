#include <cuda_runtime.h>

#include "kernels/cuda/cuda_backend.h"
#include "kernels/cuda/gaussian_vjp.cuh"
#include "kernels/cuda/launch.h"

// ProjectBackward (ProjectBackwardArgs in kernels/ops/render.h): the gradients of all parameters,
// as an op of its own. Training uses Update, which does the same and a step of Adam at once. A
// thread has one Gaussian and writes its planes; nothing is shared or summed across threads.

namespace pepeseg {
namespace {

constexpr int kBlock = 128;

struct ProjectBackwardParams {
  DevicePlanes<const float> gaussians;
  DevicePlanes<float> grad;
  int64_t count;
  int num_coefficients;  // SH coefficients of a channel that `grad` stores
  ProjectionCamera<float> camera;
  const int32_t* gaussian_visible;
  const SplatGrad* visible_grad;
  Room room;
};

// The degree is a template argument, so that loops over coefficients unroll into registers.
template <int kActiveDegree>
__global__ void __launch_bounds__(kBlock) ProjectBackwardKernel(ProjectBackwardParams p) {
  const int64_t i = int64_t{blockIdx.x} * kBlock + threadIdx.x;
  if (i >= p.count) return;
  const int32_t visible = p.gaussian_visible[i];
  GaussianBackward vjp;
  ZeroGradient(vjp);
  if (visible >= 0 && !p.room.IsVoid()) {
    BackwardGaussian<kActiveDegree>(p.gaussians, p.camera, i, p.visible_grad[visible], vjp);
  }
#pragma unroll
  for (int k = 0; k < kShPlane; ++k) p.grad.At(k, i) = vjp.shape[k];
    // All stored coefficients; `basis` is 0 beyond the active degree.
#pragma unroll
  for (int k = 0; k < NumShCoefficients(kMaxShDegree); ++k) {
    if (k >= p.num_coefficients) break;
    for (int c = 0; c < 3; ++c) p.grad.At(kShPlane + 3 * k + c, i) = vjp.basis[k] * vjp.color[c];
  }
}

void LaunchProjectBackward(const ProjectBackwardParams& p, int active_degree, cudaStream_t stream) {
  const int num_blocks = NumBlocks(p.count, kBlock);
  switch (active_degree) {
    case 0:
      return ProjectBackwardKernel<0><<<num_blocks, kBlock, 0, stream>>>(p);
    case 1:
      return ProjectBackwardKernel<1><<<num_blocks, kBlock, 0, stream>>>(p);
    case 2:
      return ProjectBackwardKernel<2><<<num_blocks, kBlock, 0, stream>>>(p);
    default:
      return ProjectBackwardKernel<3><<<num_blocks, kBlock, 0, stream>>>(p);
  }
}

}  // namespace

void CudaBackend::ProjectBackward(const ProjectBackwardArgs& args) {
  const Turn turn(*this);
  if (!turn || args.gaussians.count == 0) return;
  const RenderScratch& scratch = *args.scratch;
  LaunchProjectBackward(
      {ToDevice(args.gaussians), ToDevice(args.grad), args.gaussians.count,
       NumShCoefficients(args.grad.sh_degree), MakeProjectionCamera<float>(args.view),
       scratch.cuda.gaussian_visible.span().data, scratch.visible_grad.span().data,
       RoomOf(scratch)},
      args.active_sh_degree, stream_);
  Launched("project backward");
}

}  // namespace pepeseg
