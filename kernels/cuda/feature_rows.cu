#include <cuda_runtime.h>

#include "kernels/cuda/channel.cuh"
#include "kernels/cuda/cuda_backend.h"
#include "kernels/cuda/launch.h"

namespace pepeseg {
namespace {

constexpr int kBlock = 128;

// A warp a pixel.
__global__ void __launch_bounds__(kBlock) FeatureRowsKernel(FeatureRowsArgs args) {
  const int64_t pixel = (int64_t{blockIdx.x} * kBlock + threadIdx.x) / 32;
  const int lane = static_cast<int>(threadIdx.x) % 32;
  if (pixel + 1 >= args.rows.first.size) return;
  const EntryRange row = {args.rows.first.data[pixel], args.rows.first.data[pixel + 1],
                          args.rows.gaussian.data, args.rows.weight.data};
  args.pixel_features.data[pixel * kFeatureSize + lane] =
      WeightedSum<16>(row, args.features.data, lane);
}

}  // namespace

void CudaBackend::FeatureRows(const FeatureRowsArgs& args) {
  const Turn turn(*this);
  const int64_t num_pixels = args.rows.first.size - 1;
  if (!turn || num_pixels <= 0) return;
  FeatureRowsKernel<<<NumBlocks(num_pixels * 32, kBlock), kBlock, 0, stream_>>>(args);
  Launched("feature rows");
}

}  // namespace pepeseg
