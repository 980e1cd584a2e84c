#include <cuda_runtime.h>

#include "kernels/cuda/channel.cuh"
#include "kernels/cuda/cuda_backend.h"
#include "kernels/cuda/launch.h"

// FeatureRows (FeatureRowsArgs in kernels/ops/feature.h; METHOD.md section 3, "Rows"):
// F(p) = sum_i w_pi fbar_i. A warp has a pixel, a lane a channel, which it sums in the order of the
// row's entries: the same in every run. Blocks are four warps that share nothing.

namespace pepeseg {
namespace {

constexpr int kBlock = 128;

// 16 loads of features are in flight at once.
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
