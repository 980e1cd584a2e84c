#include <cuda_fp16.h>
#include <cuda_runtime.h>

#include <algorithm>
#include <cstdint>

#include "kernels/cuda/cuda_backend.h"
#include "kernels/math/border.h"
#include "kernels/ops/similarity.h"

// RefineBorder (kernels/ops/similarity.h). Two launches, ordered by the stream:
//   OpenPixelsKernel  one thread per pixel copies the mask, and lists the pixels that are open to
//                     change: one atomic a warp for their places, so that their order differs from
//                     run to run
//   BorderKernel      a warp decides one listed pixel after the other, with a channel of the
//   feature
//                     a lane; lanes 0 to 2 also have a channel of the colour. The window of 5 x 5
//                     pixels is first looked at with a pixel a lane, and kept as bits
// Pixels are decided from `mask`, which does not change, so that their order does not matter. A
// pixel that changes is written by one lane, and adds to the sums by atomics on integers, which are
// exact in any order. Few pixels are open, and next to each other: a warp for 32 pixels in a row
// would decide up to 32 while the others have none.

namespace pepeseg {
namespace {

constexpr int kBlock = 256;
constexpr int kSide = 2 * kBorderRadius + 1;  // of the window, pixels
static_assert(kSide * kSide <= 32 && kFeatureSize == 32, "one lane per pixel, then per channel");

struct BorderParams {
  int width, height;
  const __half* map;   // [num_pixels, 32]
  const float* color;  // [3, num_pixels]
  const float* psi;    // [32]
  const float* similarity;
  float threshold;
  const uint8_t* mask;
  uint8_t* refined;
  unsigned long long* sums;
  int32_t* num_open;     // 0 before the first launch
  int32_t* open_pixels;  // [num_pixels], the first num_open are used
};

// Returns whether a pixel of the other side is next to this one.
__device__ bool IsBorder(const BorderParams& p, int x, int y) {
  const uint8_t own = p.mask[int64_t{y} * p.width + x];
  for (int j = max(0, y - 1); j <= min(p.height - 1, y + 1); ++j) {
    for (int i = max(0, x - 1); i <= min(p.width - 1, x + 1); ++i) {
      if (p.mask[int64_t{j} * p.width + i] != own) return true;
    }
  }
  return false;
}

// Bits of the window's pixels, row by row.
struct Window {
  unsigned inside, outside;  // the pixels that describe each side
};

// Called by a whole warp.
__device__ Window WindowAround(const BorderParams& p, int x, int y) {
  const int lane = static_cast<int>(threadIdx.x) % 32;
  const int i = x + lane % kSide - kBorderRadius, j = y + lane / kSide - kBorderRadius;
  const bool shown = lane < kSide * kSide && i >= 0 && i < p.width && j >= 0 && j < p.height;
  const bool is_inside = shown && p.mask[int64_t{j} * p.width + i] != 0;
  const unsigned deep = __ballot_sync(~0u, shown && !IsBorder(p, i, j));
  const unsigned inside = __ballot_sync(~0u, is_inside);
  const unsigned outside = __ballot_sync(~0u, shown && !is_inside);
  // A thing too thin to have deep pixels is described by all of its pixels.
  return {(inside & deep) != 0 ? inside & deep : inside,
          (outside & deep) != 0 ? outside & deep : outside};
}

// Channel `lane` of the gated feature and, for lanes 0 to 2, of the colour; else 0.
struct ChannelValues {
  float feature, color;
};
__device__ ChannelValues ValuesOf(const BorderParams& p, int64_t pixel, float psi) {
  const int lane = static_cast<int>(threadIdx.x) % 32;
  const int64_t num_pixels = int64_t{p.width} * p.height;
  const float color = lane < 3 ? p.color[lane * num_pixels + pixel] : 0.0f;
  return {__half2float(p.map[pixel * kFeatureSize + lane]) * psi, fminf(fmaxf(color, 0.0f), 1.0f)};
}

struct ChannelSums {
  SideSums feature, color;

  __device__ void Add(const ChannelValues& values) {
    feature.Add(values.feature);
    color.Add(values.color);
  }
};
// Sums over the pixels of a window around (x, y), by side.
struct WindowSums {
  ChannelSums inside, outside;
};
// Unrolled, so that many loads are under way at once.
__device__ WindowSums SumOver(const BorderParams& p, int x, int y, const Window& window,
                              float psi) {
  WindowSums sums;
#pragma unroll
  for (int k = 0; k < kSide * kSide; ++k) {
    const unsigned bit = 1u << k;
    if (((window.inside | window.outside) & bit) == 0) continue;
    const int64_t row = y + k / kSide - kBorderRadius;
    const ChannelValues values = ValuesOf(p, row * p.width + x + k % kSide - kBorderRadius, psi);
    if ((window.inside & bit) != 0) {
      sums.inside.Add(values);
    } else {
      sums.outside.Add(values);
    }
  }
  return sums;
}

// Returns the sum over the lanes of a warp, to all of them.
__device__ SideComparison SumOverWarp(SideComparison of_lane) {
  for (int offset = 16; offset > 0; offset /= 2) {
    of_lane.Add({__shfl_xor_sync(~0u, of_lane.nearer, offset),
                 __shfl_xor_sync(~0u, of_lane.variance, offset)});
  }
  return of_lane;
}

// Called by a whole warp, with the same pixel.
__device__ bool BelongsInsideNow(const BorderParams& p, int x, int y, float psi) {
  const Window window = WindowAround(p, x, y);
  const auto [inside, outside] = SumOver(p, x, y, window, psi);
  const int num_inside = __popc(window.inside), num_outside = __popc(window.outside);
  const int64_t pixel = int64_t{y} * p.width + x;
  const ChannelValues at = ValuesOf(p, pixel, psi);
  const SideComparison feature = SumOverWarp(
      CompareSides(at.feature, inside.feature, num_inside, outside.feature, num_outside));
  const SideComparison color =
      SumOverWarp(CompareSides(at.color, inside.color, num_inside, outside.color, num_outside));
  return BelongsInside(feature, color, p.mask[pixel] != 0);
}

__global__ void __launch_bounds__(kBlock) OpenPixelsKernel(BorderParams p) {
  const int64_t num_pixels = int64_t{p.width} * p.height;
  const int64_t pixel = int64_t{blockIdx.x} * kBlock + threadIdx.x;
  const int lane = static_cast<int>(threadIdx.x) % 32;
  if (pixel < num_pixels) p.refined[pixel] = p.mask[pixel];
  const bool open =
      pixel < num_pixels && fabsf(p.similarity[pixel] - p.threshold) < kBorderUncertain &&
      IsBorder(p, static_cast<int>(pixel % p.width), static_cast<int>(pixel / p.width));
  // All lanes stay to the end, because the ballot is over whole warps.
  const unsigned all = __ballot_sync(~0u, open);
  if (all == 0) return;
  int first = 0;
  if (lane == 0) first = atomicAdd(p.num_open, __popc(all));
  first = __shfl_sync(~0u, first, 0);
  if (open) p.open_pixels[first + __popc(all & ((1u << lane) - 1))] = static_cast<int32_t>(pixel);
}

__global__ void __launch_bounds__(kBlock) BorderKernel(BorderParams p) {
  const int lane = static_cast<int>(threadIdx.x) % 32;
  const int num_warps = static_cast<int>(gridDim.x) * (kBlock / 32);
  const int num_open = *p.num_open;
  const float psi = p.psi[lane];
  for (int i = static_cast<int>(blockIdx.x * kBlock + threadIdx.x) / 32; i < num_open;
       i += num_warps) {
    const int at = p.open_pixels[i];
    const bool was_inside = p.mask[at] != 0;
    const bool inside = BelongsInsideNow(p, at % p.width, at / p.width, psi);
    if (lane != 0 || inside == was_inside) continue;
    p.refined[at] = inside ? 1 : 0;
    const int64_t sign = inside ? 1 : -1;
    const int64_t term = sign * __float2int_rn(p.similarity[at] * kSimilarityUnit);
    atomicAdd(&p.sums[kNumInside], static_cast<unsigned long long>(sign));
    atomicAdd(&p.sums[kSimilaritySum], static_cast<unsigned long long>(term));
  }
}

}  // namespace

void CudaBackend::RefineBorder(const RefineBorderArgs& args) {
  const Turn turn(*this);
  const int64_t num_pixels = int64_t{args.width} * args.height;
  if (!turn || num_pixels == 0) return;
  auto* const list = static_cast<int32_t*>(Temporary((1 + num_pixels) * sizeof(int32_t)));
  if (list == nullptr) return;
  Keep(cudaMemsetAsync(list, 0, sizeof(int32_t), stream_), "clearing a count");
  const BorderParams params = {args.width,
                               args.height,
                               reinterpret_cast<const __half*>(args.map.data),
                               args.color.data,
                               args.psi.data,
                               args.similarity.data,
                               args.threshold,
                               args.mask.data,
                               args.refined.data,
                               reinterpret_cast<unsigned long long*>(args.sums.data),
                               list,
                               list + 1};
  OpenPixelsKernel<<<NumBlocks(num_pixels, kBlock), kBlock, 0, stream_>>>(params);
  Launched("open pixels");
  constexpr int kMostBlocks = 1'024;  // of eight pixels each; a border at 1 Mpx has some thousands
  BorderKernel<<<std::min(kMostBlocks, NumBlocks(num_pixels, kBlock / 32)), kBlock, 0, stream_>>>(
      params);
  Launched("refine border");
}

}  // namespace pepeseg
