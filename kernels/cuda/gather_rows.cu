#include <cuda_runtime.h>

#include "kernels/cuda/cuda_backend.h"
#include "kernels/cuda/device_planes.cuh"
#include "kernels/cuda/launch.h"

namespace pepeseg {
namespace {

constexpr int kBlock = 256;

__global__ void __launch_bounds__(kBlock)
    GatherKernel(const int32_t* source, int64_t count, DevicePlanes<const float> from,
                 DevicePlanes<float> to) {
  const int64_t i = int64_t{blockIdx.x} * kBlock + threadIdx.x;
  if (i >= count) return;
  const int plane = static_cast<int>(blockIdx.y);
  const int32_t row = source[i];
  to.At(plane, i) = row < 0 ? 0.0f : from.At(plane, row);
}

}  // namespace

void CudaBackend::GatherRows(const GatherRowsArgs& args) {
  const Turn turn(*this);
  if (!turn || args.to.count == 0) return;
  const dim3 grid(NumBlocks(args.to.count, kBlock), NumPlanes(args.to.sh_degree));
  GatherKernel<<<grid, kBlock, 0, stream_>>>(args.source.data, args.to.count, ToDevice(args.from),
                                             ToDevice(args.to));
  Launched("gather rows");
}

}  // namespace pepeseg
