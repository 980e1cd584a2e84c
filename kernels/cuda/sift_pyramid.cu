#include <cuda_runtime.h>

#include "kernels/cuda/cuda_backend.h"
#include "kernels/cuda/sift_pyramid.cuh"

// The scale space of SIFT: octaves of blurred images (kernels/sift_scales.h).
//
// A blur is two kernels, down and then across, with the image between them in temporary memory.
//   DownKernel    thread = a column of kDownRows pixels, which share the scanlines that they read;
//                 a warp reads 32 neighbouring columns
//   AcrossKernel  block = a piece of a scanline, which it loads into shared memory with its
//                 surroundings; thread = 4 neighbouring pixels, by loads of 4 floats
// Radii are rounded up to one of two, so that loops unroll; the further taps are 0. Threads share
// nothing but the piece of the scanline. Every sum has a fixed order.

namespace pepeseg {
namespace {

constexpr int kPixelBlock = 256;
constexpr int kDownRows = 8, kDownBlockX = 32, kDownBlockY = 4;
constexpr int kAcrossBlock = 128, kAcrossPixels = 4 * kAcrossBlock;
constexpr int kSmallRadius = 8;

__global__ void __launch_bounds__(kPixelBlock)
    LoadPhotographKernel(const uint8_t* grey, SiftOctave octave, int level) {
  const int x = static_cast<int>(blockIdx.x) * kPixelBlock + static_cast<int>(threadIdx.x);
  const int64_t y = blockIdx.y;
  if (x < octave.width) octave.Row(level, y)[x] = grey[y * octave.width + x] * (1.0f / 255);
}

// Thread = a pixel of octave -1: the mean of the one, two or four pixels that are nearest.
__global__ void __launch_bounds__(kPixelBlock)
    UpsampleKernel(const uint8_t* grey, SiftOctave octave, int level) {
  const int x = static_cast<int>(blockIdx.x) * kPixelBlock + static_cast<int>(threadIdx.x);
  const int y = static_cast<int>(blockIdx.y);
  if (x >= octave.width) return;
  const int width = octave.width / 2, height = octave.height / 2;
  const int left = x / 2, right = min(left + x % 2, width - 1);
  const int64_t above = y / 2, below = min(y / 2 + y % 2, height - 1);
  const int sum = grey[above * width + left] + grey[above * width + right] +
                  grey[below * width + left] + grey[below * width + right];
  octave.Row(level, y)[x] = static_cast<float>(sum) * (1.0f / (4 * 255));
}

__global__ void __launch_bounds__(kPixelBlock) HalveKernel(SiftOctave from, SiftOctave to) {
  const int x = static_cast<int>(blockIdx.x) * kPixelBlock + static_cast<int>(threadIdx.x);
  const int64_t y = blockIdx.y;
  if (x < to.width) to.Row(0, y)[x] = from.Row(kSiftStep, 2 * y)[2 * x];
}

struct BlurParams {
  const float* in;  // a level
  float* out;
  int width, height;
  int64_t stride;
  SiftTaps taps;
};

template <int kRadius>
__global__ void __launch_bounds__(kDownBlockX* kDownBlockY) DownKernel(BlurParams p) {
  const int x = static_cast<int>(blockIdx.x) * kDownBlockX + static_cast<int>(threadIdx.x);
  const int first =
      (static_cast<int>(blockIdx.y) * kDownBlockY + static_cast<int>(threadIdx.y)) * kDownRows;
  if (x >= p.width || first >= p.height) return;
  float sum[kDownRows] = {};
#pragma unroll
  for (int j = -kRadius; j < kDownRows + kRadius; ++j) {
    const int64_t y = min(max(first + j, 0), p.height - 1);
    const float value = p.in[y * p.stride + x];
#pragma unroll
    for (int k = 0; k < kDownRows; ++k) {
      const int distance = j < k ? k - j : j - k;
      if (distance <= kRadius) sum[k] += p.taps.tap[distance] * value;
    }
  }
#pragma unroll
  for (int k = 0; k < kDownRows; ++k) {
    if (first + k < p.height) p.out[int64_t{first + k} * p.stride + x] = sum[k];
  }
}

template <int kRadius>
__global__ void __launch_bounds__(kAcrossBlock) AcrossKernel(BlurParams p) {
  constexpr int kMargin = (kRadius + 3) / 4 * 4;   // floats before the piece
  constexpr int kVectors = (2 * kMargin + 4) / 4;  // loads of a thread
  __shared__ float4 piece[(kAcrossPixels + 2 * kMargin) / 4];
  const int first = static_cast<int>(blockIdx.x) * kAcrossPixels;
  const int thread = static_cast<int>(threadIdx.x);
  const float* in = p.in + blockIdx.y * p.stride;
  auto* floats = reinterpret_cast<float*>(piece);
  for (int i = thread; i < kAcrossPixels + 2 * kMargin; i += kAcrossBlock) {
    floats[i] = in[min(max(first - kMargin + i, 0), p.width - 1)];
  }
  __syncthreads();
  float value[4 * kVectors];
#pragma unroll
  for (int k = 0; k < kVectors; ++k) {
    const float4 four = piece[thread + k];
    value[4 * k] = four.x, value[4 * k + 1] = four.y;
    value[4 * k + 2] = four.z, value[4 * k + 3] = four.w;
  }
  float sum[4] = {};
#pragma unroll
  for (int j = -kRadius; j <= kRadius; ++j) {
#pragma unroll
    for (int k = 0; k < 4; ++k) sum[k] += p.taps.tap[j < 0 ? -j : j] * value[kMargin + k + j];
  }
  // The stride is a multiple of 4, so that a vector that begins within the scanline fits into it.
  const int x = first + 4 * thread;
  if (x >= p.width) return;
  *reinterpret_cast<float4*>(p.out + blockIdx.y * p.stride + x) =
      make_float4(sum[0], sum[1], sum[2], sum[3]);
}

template <int kRadius>
void LaunchBlur(BlurParams down, BlurParams across, cudaStream_t stream) {
  const dim3 down_grid(NumBlocks(down.width, kDownBlockX),
                       NumBlocks(down.height, kDownBlockY * kDownRows));
  DownKernel<kRadius><<<down_grid, dim3(kDownBlockX, kDownBlockY), 0, stream>>>(down);
  const dim3 across_grid(NumBlocks(across.width, kAcrossPixels), across.height);
  AcrossKernel<kRadius><<<across_grid, kAcrossBlock, 0, stream>>>(across);
}

void Blur(const SiftBuild& build, int from, int to, const SiftTaps& taps) {
  const SiftOctave& octave = build.octaves[build.index];
  BlurParams down = {octave.Row(from, 0), build.temporary, octave.width,
                     octave.height,       octave.stride,   taps};
  BlurParams across = down;
  across.in = build.temporary;
  across.out = octave.Row(to, 0);
  if (taps.radius <= kSmallRadius) {
    LaunchBlur<kSmallRadius>(down, across, build.stream);
  } else {
    LaunchBlur<kMaxSiftRadius>(down, across, build.stream);
  }
}

}  // namespace

// As on the CPU, the last level first holds what level 0 is made from.
cudaError_t BuildSiftOctave(const SiftBuild& build) {
  const SiftOctave& octave = build.octaves[build.index];
  constexpr int kLast = kSiftLevels - 1;
  const dim3 grid(NumBlocks(octave.width, kPixelBlock), octave.height);
  if (build.index == 0) {
    UpsampleKernel<<<grid, kPixelBlock, 0, build.stream>>>(build.grey, octave, kLast);
    Blur(build, kLast, 0, SiftFinestTaps());
  } else if (build.index == 1) {
    LoadPhotographKernel<<<grid, kPixelBlock, 0, build.stream>>>(build.grey, octave, kLast);
    Blur(build, kLast, 0, SiftPhotographTaps());
  } else {
    HalveKernel<<<grid, kPixelBlock, 0, build.stream>>>(build.octaves[build.index - 1], octave);
  }
  for (int level = 1; level < kSiftLevels; ++level) {
    Blur(build, level - 1, level, SiftLevelTaps(level));
  }
  return cudaGetLastError();
}

}  // namespace pepeseg
