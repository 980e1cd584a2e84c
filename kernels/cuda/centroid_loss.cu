#include <cuda_runtime.h>

#include "kernels/cuda/channel.cuh"
#include "kernels/cuda/cuda_backend.h"

// CentroidLoss (CentroidLossArgs in kernels/ops/feature.h; METHOD.md section 3, "Centroids").
// Launches, ordered by the stream:
//   NearKernel  one warp per pixel: its nearest centroid above min_cosine. Lane i tests centroids
//               i, i + 32, ...; the pixel's unit vector is in shared memory, a row per warp
//               (__syncwarp); shuffles find the best lane, on ties that of the first centroid
//   SumKernel   one block: loss and count, as a tree in shared memory (__syncthreads)
//   GradKernel  one warp per pixel, one lane per channel: gradients of the feature and of psi
//   GateKernel  one block: the gradients of psi over the pixels, then of the gate
// There are no atomics, and all sums have a fixed order: the same in every run.

namespace pepeseg {
namespace {

constexpr int kBlock = 256;
constexpr int kWarps = kBlock / 32;

// Nearest centroid of a pixel.
struct Near {
  int32_t index;  // -1: no centroid is near
  float cosine;
};

// Channel k of psi.
__device__ float PsiOf(const CentroidLossArgs& args, int k) {
  return PsiChannel(args.gate, args.scale, k);
}

__global__ void __launch_bounds__(kBlock) NearKernel(CentroidLossArgs args, Near* near) {
  __shared__ float units[kWarps][kFeatureSize];
  const int warp = static_cast<int>(threadIdx.x) / 32, lane = static_cast<int>(threadIdx.x) % 32;
  const int64_t pixel = int64_t{blockIdx.x} * kWarps + warp;
  if (pixel * kFeatureSize >= args.pixel_features.size) return;
  const Channel psi(PsiOf(args, lane));
  const Channel feature(args.pixel_features.data[pixel * kFeatureSize + lane]);
  Channel unit(0);
  GatedUnit(&psi, &feature, 1, &unit);
  units[warp][lane] = unit.v;
  __syncwarp();
  const auto num_centroids = static_cast<int>(args.centroids.size / kFeatureSize);
  Near best = {-1, args.min_cosine};
  for (int k = lane; k < num_centroids; k += 32) {
    const float* centroid = args.centroids.data + int64_t{k} * kFeatureSize;
    float cosine = 0;
    for (int c = 0; c < kFeatureSize; ++c) cosine = MulAdd(units[warp][c], centroid[c], cosine);
    if (cosine > best.cosine) best = {k, cosine};
  }
  // The first centroid with the largest cosine wins.
  for (int offset = 16; offset > 0; offset /= 2) {
    const Near other = {__shfl_xor_sync(~0u, best.index, offset),
                        __shfl_xor_sync(~0u, best.cosine, offset)};
    const bool first = best.index < 0 || other.index < best.index;
    if (other.index < 0) continue;
    if (other.cosine > best.cosine || (other.cosine == best.cosine && first)) best = other;
  }
  if (lane == 0) near[pixel] = best;
}

// Sums in double. GradKernel reads the count from `sums`.
__global__ void __launch_bounds__(kBlock) SumKernel(CentroidLossArgs args, const Near* near) {
  __shared__ double losses[kBlock], counts[kBlock];
  const int t = static_cast<int>(threadIdx.x);
  losses[t] = counts[t] = 0;
  for (int64_t p = t; p < args.pixel_features.size / kFeatureSize; p += kBlock) {
    if (near[p].index < 0) continue;
    losses[t] += 1 - static_cast<double>(near[p].cosine);
    ++counts[t];
  }
  for (int half = kBlock / 2; half > 0; half /= 2) {
    __syncthreads();
    if (t >= half) continue;
    losses[t] += losses[t + half];
    counts[t] += counts[t + half];
  }
  if (t != 0) return;
  args.sums.data[kCentroidLoss] = losses[0];
  args.sums.data[kNumNearCentroids] = counts[0];
}

// Adds to pixel_grad and writes the gradient of psi, 0 for pixels that are near no centroid.
__global__ void __launch_bounds__(kBlock)
    GradKernel(CentroidLossArgs args, const Near* near, float* psi_grads) {
  const int64_t pixel = int64_t{blockIdx.x} * kWarps + threadIdx.x / 32;
  const int lane = static_cast<int>(threadIdx.x) % 32;
  if (pixel * kFeatureSize >= args.pixel_features.size) return;
  const int64_t at = pixel * kFeatureSize + lane;
  Channel psi_grad(0);
  if (near[pixel].index >= 0) {
    const auto count = static_cast<float>(args.sums.data[kNumNearCentroids]);
    const Channel psi(PsiOf(args, lane)), feature(args.pixel_features.data[at]);
    const int64_t centroid = int64_t{near[pixel].index} * kFeatureSize + lane;
    const Channel unit_grad(-args.weight / count * args.centroids.data[centroid]);
    Channel grad(args.pixel_grad.data[at]);
    GatedUnitVjp(&psi, &feature, 1, &unit_grad, &grad, &psi_grad);
    args.pixel_grad.data[at] = grad.v;
  }
  psi_grads[at] = psi_grad.v;
}

// Each warp sums every kWarps-th pixel, then warp 0 sums the warps.
__global__ void __launch_bounds__(kBlock)
    GateKernel(CentroidLossArgs args, const float* psi_grads) {
  __shared__ float sums[kWarps][kFeatureSize];
  const int warp = static_cast<int>(threadIdx.x) / 32, lane = static_cast<int>(threadIdx.x) % 32;
  float sum = 0;
  for (int64_t at = warp * kFeatureSize + lane; at < args.pixel_features.size; at += kBlock) {
    sum += psi_grads[at];
  }
  sums[warp][lane] = sum;
  __syncthreads();
  if (warp != 0) return;
  float psi_grad = 0;
  for (int w = 0; w < kWarps; ++w) psi_grad += sums[w][lane];
  const float bias_grad = GateVjp(PsiOf(args, lane), psi_grad);
  if (HasTwoLayers(args.gate.size, kFeatureSize)) {
    return AddTwoLayerGrad(args.gate.data, args.scale, bias_grad, args.gate_grad.data);
  }
  args.gate_grad.data[lane] += args.scale * bias_grad;
  args.gate_grad.data[kFeatureSize + lane] += bias_grad;
}

}  // namespace

void CudaBackend::CentroidLoss(const CentroidLossArgs& args) {
  const Turn turn(*this);
  const int64_t num_pixels = args.pixel_features.size / kFeatureSize;
  if (!turn || num_pixels == 0) return;
  const auto take = [&](Arena& arena) {
    return std::pair(arena.Take<Near>(num_pixels), arena.Take<float>(num_pixels * kFeatureSize));
  };
  Arena sizes;
  take(sizes);
  Arena arena(Temporary(sizes.num_bytes()));
  const auto [near, psi_grads] = take(arena);
  if (!error_.empty()) return;
  const int num_blocks = NumBlocks(num_pixels, kWarps);
  NearKernel<<<num_blocks, kBlock, 0, stream_>>>(args, near);
  SumKernel<<<1, kBlock, 0, stream_>>>(args, near);
  GradKernel<<<num_blocks, kBlock, 0, stream_>>>(args, near, psi_grads);
  GateKernel<<<1, kBlock, 0, stream_>>>(args, psi_grads);
  Launched("centroid loss");
}

}  // namespace pepeseg
