#include <cuda_runtime.h>

#include "kernels/cuda/cuda_backend.h"
#include "kernels/cuda/network_tile.cuh"
#include "kernels/math/activation.h"
#include "kernels/math/frame.h"

// PrepareFrame, LayerNorm and DepthwiseConvolve (kernels/ops/network.h): layers that read each
// value a few times at most and are bound by memory.
//
// FrameKernel: one thread per pixel of the frame. LayerNormKernel: one warp per row. A lane owns
// channels in units of 4, and the sums of lanes are added by shuffles. DepthwiseKernel: a thread
// owns 4 channels of a part of 2 scanlines and 4 columns of the output, so that it reads 24 values
// of a channel for 8 of the output with stride 1; neighbours find the others in the L1 cache.
// Nothing is in shared memory.

namespace pepeseg {
namespace {

constexpr int kBlock = 256;

template <class T>
__global__ void __launch_bounds__(kBlock) FrameKernel(ScaledPhoto photo, int extent, T* output) {
  const int x = static_cast<int>(blockIdx.x * kBlock + threadIdx.x);
  const int y = static_cast<int>(blockIdx.y);
  if (x >= extent) return;
  float rgb[3];
  FramePixel(photo, y, x, rgb);
  const float values[kFrameChannels] = {rgb[0], rgb[1], rgb[2]};
  StoreValues<kFrameChannels>(values, output + (int64_t{y} * extent + x) * kFrameChannels);
}

__device__ inline float SumOfWarp(float x) {
#pragma unroll
  for (int step = 16; step > 0; step /= 2) x += __shfl_xor_sync(~0u, x, step);
  return x;
}

template <class T, class To>
__global__ void __launch_bounds__(kBlock) LayerNormKernel(LayerNormArgs args) {
  const int64_t row = int64_t{blockIdx.x} * (kBlock / 32) + threadIdx.x / 32;
  if (row >= args.rows) return;
  const int lane = static_cast<int>(threadIdx.x) % 32;
  const T* input = static_cast<const T*>(args.input.data) + row * args.channels;
  To* output = static_cast<To*>(args.output.data) + row * args.channels;
  float sum = 0, squares = 0;
  for (int c = lane * 4; c < args.channels; c += 128) {
    float x[4];
    LoadValues<4>(input + c, x);
    sum += (x[0] + x[1]) + (x[2] + x[3]);
  }
  const float mean = SumOfWarp(sum) / args.channels;
  for (int c = lane * 4; c < args.channels; c += 128) {
    float x[4];
    LoadValues<4>(input + c, x);
#pragma unroll
    for (const float value : x) squares += (value - mean) * (value - mean);
  }
  const float scale = rsqrtf(SumOfWarp(squares) / args.channels + args.epsilon);
  for (int c = lane * 4; c < args.channels; c += 128) {
    float x[4], scales[4], shifts[4];
    LoadValues<4>(input + c, x);
    LoadValues<4>(args.scale.data + c, scales);
    LoadValues<4>(args.shift.data + c, shifts);
#pragma unroll
    for (int k = 0; k < 4; ++k) x[k] = (x[k] - mean) * scale * scales[k] + shifts[k];
    StoreValues<4>(x, output + c);
  }
}

constexpr int kTall = 2, kWide = 4;  // part of the output that a thread owns

template <class T, int kStride>
__global__ void __launch_bounds__(kBlock)
    DepthwiseKernel(DepthwiseConvolveArgs args, int height, int width) {
  constexpr int kColumns = (kWide - 1) * kStride + 3, kRows = (kTall - 1) * kStride + 3;
  const int fours = args.channels / 4;
  int64_t index = int64_t{blockIdx.x} * kBlock + threadIdx.x;
  const int channel = static_cast<int>(index % fours) * 4;
  index /= fours;
  const int parts = (width + kWide - 1) / kWide;
  const int x = static_cast<int>(index % parts) * kWide;
  index /= parts;
  const int tall_parts = (height + kTall - 1) / kTall;
  const int y = static_cast<int>(index % tall_parts) * kTall;
  const auto image = static_cast<int>(index / tall_parts);
  if (image >= args.num_images) return;
  const T* input = static_cast<const T*>(args.input.data) +
                   int64_t{image} * args.height * args.width * args.channels + channel;
  float weights[9][4], sums[kTall][kWide][4];
#pragma unroll
  for (int tap = 0; tap < 9; ++tap) {
    LoadValues<4>(args.weights.data + tap * args.channels + channel, weights[tap]);
  }
#pragma unroll
  for (int k = 0; k < kTall * kWide; ++k) {
    LoadValues<4>(args.bias.data + channel, sums[k / kWide][k % kWide]);
  }
#pragma unroll
  for (int r = 0; r < kRows; ++r) {
    // The loads of a row are under way together: zeros outside instead of branches.
    float row[kColumns][4] = {};
    const int from_y = y * kStride - 1 + r;
    const bool row_inside = from_y >= 0 && from_y < args.height;
#pragma unroll
    for (int s = 0; s < kColumns; ++s) {
      const int from_x = x * kStride - 1 + s;
      const bool inside = row_inside && from_x >= 0 && from_x < args.width;
      const int64_t at = inside ? (int64_t{from_y} * args.width + from_x) * args.channels : 0;
      LoadValues<4>(input + at, row[s]);
#pragma unroll
      for (float& value : row[s]) value = inside ? value : 0.0f;
    }
#pragma unroll
    for (int s = 0; s < kColumns; ++s) {
      const float(&value)[4] = row[s];
      // Adds the value to each output that has it under one of its taps.
#pragma unroll
      for (int tap = 0; tap < 9; ++tap) {
        const int down = r - tap / 3, across = s - tap % 3;
        if (down < 0 || down % kStride != 0 || down / kStride >= kTall) continue;
        if (across < 0 || across % kStride != 0 || across / kStride >= kWide) continue;
#pragma unroll
        for (int c = 0; c < 4; ++c) {
          sums[down / kStride][across / kStride][c] += value[c] * weights[tap][c];
        }
      }
    }
  }
#pragma unroll
  for (int k = 0; k < kTall * kWide; ++k) {
    const int to_y = y + k / kWide, to_x = x + k % kWide;
    if (to_y >= height || to_x >= width) continue;
    float(&values)[4] = sums[k / kWide][k % kWide];
    if (args.activation == Activation::kGelu) {
#pragma unroll
      for (float& value : values) value = Gelu(value);
    } else if (args.activation == Activation::kRelu) {
#pragma unroll
      for (float& value : values) value = fmaxf(value, 0.0f);
    }
    StoreValues<4>(values, static_cast<T*>(args.output.data) +
                               ((int64_t{image} * height + to_y) * width + to_x) * args.channels +
                               channel);
  }
}

template <class T>
void LaunchDepthwise(const DepthwiseConvolveArgs& args, cudaStream_t stream) {
  const int height = ConvolvedExtent(args.height, args.stride);
  const int width = ConvolvedExtent(args.width, args.stride);
  const int64_t count = int64_t{args.num_images} * NumBlocks(height, kTall) *
                        NumBlocks(width, kWide) * (args.channels / 4);
  if (args.stride == 1) {
    DepthwiseKernel<T, 1><<<NumBlocks(count, kBlock), kBlock, 0, stream>>>(args, height, width);
  } else {
    DepthwiseKernel<T, 2><<<NumBlocks(count, kBlock), kBlock, 0, stream>>>(args, height, width);
  }
}

}  // namespace

void CudaBackend::PrepareFrame(const PrepareFrameArgs& args) {
  const Turn turn(*this);
  if (!turn) return;
  const ScaledPhoto photo = ScaleToExtent(args.photo.data, args.height, args.width, args.extent);
  const dim3 blocks(NumBlocks(args.extent, kBlock), args.extent);
  if (args.output.precision == Precision::kHalf) {
    FrameKernel<<<blocks, kBlock, 0, stream_>>>(photo, args.extent,
                                                static_cast<__half*>(args.output.data));
  } else {
    FrameKernel<<<blocks, kBlock, 0, stream_>>>(photo, args.extent,
                                                static_cast<float*>(args.output.data));
  }
  Launched("prepare frame");
}

void CudaBackend::LayerNorm(const LayerNormArgs& args) {
  const Turn turn(*this);
  if (!turn || args.rows == 0) return;
  const int blocks = NumBlocks(args.rows, kBlock / 32);
  if (args.input.precision == Precision::kFloat) {
    LayerNormKernel<float, float><<<blocks, kBlock, 0, stream_>>>(args);
  } else if (args.output.precision == Precision::kFloat) {
    LayerNormKernel<__half, float><<<blocks, kBlock, 0, stream_>>>(args);
  } else {
    LayerNormKernel<__half, __half><<<blocks, kBlock, 0, stream_>>>(args);
  }
  Launched("layer norm");
}

void CudaBackend::DepthwiseConvolve(const DepthwiseConvolveArgs& args) {
  const Turn turn(*this);
  if (!turn || args.num_images == 0) return;
  if (args.input.precision == Precision::kHalf) {
    LaunchDepthwise<__half>(args, stream_);
  } else {
    LaunchDepthwise<float>(args, stream_);
  }
  Launched("depthwise convolve");
}

}  // namespace pepeseg
