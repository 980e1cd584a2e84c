#include <cuda_runtime.h>

#include "kernels/cuda/cuda_backend.h"
#include "kernels/cuda/device_planes.cuh"

// AddWeights (AddWeightsArgs in kernels/ops/render.h): one thread per visible splat adds the
// gradient of its colour to the sums of its Gaussian. Threads share nothing. A Gaussian is visible
// at most once in a render, so there are no atomics, and sums are the same in every run.

namespace pepeseg {
namespace {

constexpr int kBlock = 256;

struct AddWeightsParams {
  Room room;
  const int32_t* visible_gaussian;
  const SplatGrad* visible_grad;
  int num_planes;
  int64_t stride;  // elements between the planes of `sums`
  float* sums;
};

__global__ void __launch_bounds__(kBlock) AddWeightsKernel(AddWeightsParams p) {
  const int64_t i = int64_t{blockIdx.x} * kBlock + threadIdx.x;
  if (i >= p.room.counters[kNumVisible] || p.room.IsVoid()) return;
  const SplatGrad& grad = p.visible_grad[i];
  float* sums = p.sums + p.visible_gaussian[i];
  sums[0] += grad.r;
  if (p.num_planes > 1) sums[p.stride] += grad.g;
  if (p.num_planes > 2) sums[2 * p.stride] += grad.b;
}

}  // namespace

// The grid has the upper bound of the number of visible splats, which the host may not know.
void CudaBackend::AddWeights(const AddWeightsArgs& args) {
  const Turn turn(*this);
  const RenderScratch& scratch = *args.scratch;
  const int64_t num_visible = scratch.visible_splat.size();
  if (!turn || num_visible == 0) return;
  AddWeightsKernel<<<NumBlocks(num_visible, kBlock), kBlock, 0, stream_>>>(
      {RoomOf(scratch), scratch.visible_gaussian.span().data, scratch.visible_grad.span().data,
       args.num_planes, args.sums.size / args.num_planes, args.sums.data});
  Launched("add weights");
}

}  // namespace pepeseg
