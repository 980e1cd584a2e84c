#include <cuda_runtime.h>

#include "kernels/cuda/cuda_backend.h"
#include "kernels/cuda/device_planes.cuh"
#include "kernels/cuda/launch.h"

// GatherRows (GatherRowsArgs in kernels/ops/density.h): copies the Gaussians that PlanDensity lists
// into new planes. One launch; a thread has one Gaussian in one plane. Writes coalesce; reads do as
// far as neighbours in the new order were neighbours in the old one. Nothing is shared or summed.

namespace pepeseg {
namespace {

constexpr int kBlock = 256;

struct GatherParams {
  const int32_t* source;
  const uint8_t* is_zero;  // may be null
  int64_t count;
  int num_planes;
  DevicePlanes<const float> from;
  DevicePlanes<float> to;
  const int32_t* number_from;
  int32_t* number_to;  // may be null
};

// blockIdx.y is the plane; the one after the last stands for `number`.
__global__ void __launch_bounds__(kBlock) GatherKernel(GatherParams p) {
  const int64_t i = int64_t{blockIdx.x} * kBlock + threadIdx.x;
  if (i >= p.count) return;
  const int plane = static_cast<int>(blockIdx.y);
  const int32_t row = p.source[i];
  const bool zero = p.is_zero != nullptr && p.is_zero[i] != 0;
  if (plane < p.num_planes) {
    p.to.At(plane, i) = zero ? 0.0f : p.from.At(plane, row);
  } else {
    p.number_to[i] = zero ? 0 : p.number_from[row];
  }
}

}  // namespace

void CudaBackend::GatherRows(const GatherRowsArgs& args) {
  const Turn turn(*this);
  if (!turn || args.to.count == 0) return;
  const int num_planes = NumPlanes(args.to.sh_degree);
  const int num_numbers = args.number_to.empty() ? 0 : 1;
  const dim3 grid(NumBlocks(args.to.count, kBlock), num_planes + num_numbers);
  GatherKernel<<<grid, kBlock, 0, stream_>>>({args.source.data, args.is_zero.data, args.to.count,
                                              num_planes, ToDevice(args.from), ToDevice(args.to),
                                              args.number_from.data, args.number_to.data});
  Launched("gather rows");
}

}  // namespace pepeseg
