#include <cuda_runtime.h>

#include "kernels/cuda/channel.cuh"
#include "kernels/cuda/pair_work.cuh"

// Fourth pass of PairLoss: the gradient of each pixel's feature and of the gate, through the gated
// and normalised features at all scales (GatedUnitVjp of kernels/math/pair.h), and the norm term.
//
// A warp has a pixel, a lane a channel; a block is kPixelWarps warps. Norms are shuffles over the
// warp. Shared memory holds the gradients of psi and the norm term of each warp; after one
// __syncthreads the block adds them over its warps and stores them for pair_sums.cu. All sums have
// a fixed order: over the parts of pair_gradients.cu, the scales, the warps.

namespace pepeseg {
namespace {

constexpr int kPixelBlock = 32 * kPixelWarps;
struct PixelShared {
  float psi_grad[kPixelWarps][kMaxScales * kFeatureSize];
  double norm_loss[kPixelWarps];
};

// Returns one channel of the gradient of pixel p through all scales, and writes those of psi to
// psi_grads[scales, 32].
__device__ Channel BackwardPixel(const PairWork& work, int p, const Channel& feature,
                                 float* psi_grads) {
  const int lane = static_cast<int>(threadIdx.x) % 32;
  Channel grad(0);
#pragma unroll 2
  for (int scale = 0; scale < work.num_scales; ++scale) {
    float sum = 0;
#pragma unroll
    for (int split = 0; split < kPairSplits; ++split) {
      const int64_t row = (int64_t{split} * work.num_scales + scale) * work.padded + p;
      sum += work.unit_grad[row * kFeatureSize + lane];
    }
    const Channel psi(work.psi[scale * kFeatureSize + lane]);
    const Channel unit_grad = psi * Channel(sum);
    Channel psi_grad(0);
    GatedUnitVjp(&psi, &feature, 1, &unit_grad, &grad, &psi_grad);
    psi_grads[scale * kFeatureSize + lane] = psi_grad.v;
  }
  return grad;
}

// Warps of the padding take part in the sums with zeros.
__global__ void __launch_bounds__(kPixelBlock) PixelGradientKernel(PairWork work) {
  __shared__ PixelShared shared;
  const int warp = static_cast<int>(threadIdx.x) / 32, lane = static_cast<int>(threadIdx.x) % 32;
  const int p = static_cast<int>(blockIdx.x) * kPixelWarps + warp;
  const bool is_pixel = p < work.num_pixels;  // a row of padding has no gradient
  const int64_t i = int64_t{p} * kFeatureSize + lane;
  const Channel feature(is_pixel ? work.args.pixel_features.data[i] : 0.0f);
  Channel grad = BackwardPixel(work, p, feature, shared.psi_grad[warp]);
  float norm_loss = 0;
  if (is_pixel && work.args.pixel_alpha.data[p] > work.args.min_norm_alpha) {
    norm_loss = NormTerm(&feature, 1).v;
    const Channel pull = NormTermVjp(&feature, 1, Channel(Inverse(work.counts->norm_pixels)));
    grad = MulAdd(pull, feature, grad);
  }
  if (is_pixel) work.args.pixel_grad.data[i] = grad.v;
  if (lane == 0) shared.norm_loss[warp] = static_cast<double>(norm_loss);
  __syncthreads();
  const int num_psi = work.num_scales * kFeatureSize;
  for (int at = static_cast<int>(threadIdx.x); at < num_psi; at += kPixelBlock) {
    float sum = 0;
    for (const auto& of_warp : shared.psi_grad) sum += of_warp[at];
    work.psi_grad[blockIdx.x * num_psi + at] = sum;
  }
  if (threadIdx.x != 0) return;
  double sum = 0;
  for (const double of_warp : shared.norm_loss) sum += of_warp;
  work.norm_loss[blockIdx.x] = sum;
}

}  // namespace

void LaunchPixelGradients(const PairWork& work, cudaStream_t stream) {
  PixelGradientKernel<<<NumPixelBlocks(work), kPixelBlock, 0, stream>>>(work);
}

}  // namespace pepeseg
