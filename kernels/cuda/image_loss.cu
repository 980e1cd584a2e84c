#include <cuda_runtime.h>

#include "kernels/cuda/cuda_backend.h"
#include "kernels/math/ssim.h"

// ImageLoss (ImageLossArgs in kernels/ops/render.h; METHOD.md section 1): L1 and SSIM of a render
// against its photograph, and the gradient of the colours (kernels/math/ssim.h). Launches, ordered
// by the stream:
//   CountPixelsKernel  pixels that are not ignored, by integer atomics; only with an ignore mask
//   MomentKernel       moments of the window around each pixel, sums of the loss by block, and the
//                      gradients of the moments as maps in global memory
//   SumPartialsKernel  one block: the sums of the blocks
//   LossGradKernel     the maps filtered again: a pixel gathers from all windows that hold it
//
// MomentKernel and LossGradKernel: one block per tile of 32x32 pixels of one channel. It loads
// the tile and a margin of 5 pixels into shared memory, filters along x into a second array there,
// and then each thread filters a column of 4 pixels along y. __syncthreads separates the three. The
// window is separable, so a pixel takes 22 taps and not 121.
//
// Order of sums: a thread adds its 4 pixels, shuffles add over the warp, thread k adds sum k of the
// warps in double (StorePartials), and SumPartialsKernel adds the blocks in double, all in fixed
// orders. So the sums are the same in every run.

namespace pepeseg {
namespace {

constexpr int kTile = 32;  // pixels per side of a block's tile
constexpr int kWide = kTile + 2 * kSsimRadius;
// Floats between scanlines. A warp filters 4 scanlines at 8 columns that are 4 apart; with 45
// floats, 13 modulo 32, these 32 reads meet different banks.
constexpr int kPitch = 45;
constexpr int kBlock = 256;
constexpr int kRun = 4;                       // neighbouring outputs that a thread filters together
constexpr int kNumMoments = 4, kNumMaps = 3;  // of SsimMoments, of SsimMomentsGrad
static_assert(kTile * kTile == kBlock * kRun);

struct LossParams {
  int width, height;
  const float* color;
  const uint8_t* target;
  const uint8_t* ignore;       // may be null
  const int64_t* num_counted;  // pixels that are not ignored; null: all
  float l1_weight, ssim_weight;
  float taps[kSsimRadius + 1];
  float* maps;       // [kNumMaps, 3, H, W]; null: evaluate only
  double* partials;  // [blocks, 3] sums kSumL1, kSumSsim and kSumSquared
  float* color_grad;
};

// Number of (pixel, channel) that count, by which the means are divided; 1 if there is none.
__device__ float PixelChannels(const LossParams& p) {
  const int64_t num_counted =
      p.num_counted != nullptr ? *p.num_counted : int64_t{p.width} * p.height;
  return static_cast<float>(max(int64_t{1}, 3 * num_counted));
}

// One channel of a pixel: rendered and photographed, in [0, 1] for the photograph.
struct PixelPair {
  float x, y;
  bool counts;
};

// Outside the image both are 0. An ignored pixel shows the photograph in both.
__device__ PixelPair LoadPixel(const LossParams& p, int channel, int x, int y) {
  if (x < 0 || y < 0 || x >= p.width || y >= p.height) return {0, 0, false};
  const int64_t pixel = int64_t{y} * p.width + x;
  const float target = p.target[3 * pixel + channel] * (1.0f / 255);
  if (p.ignore != nullptr && p.ignore[pixel] != 0) return {target, target, false};
  return {p.color[int64_t{channel} * p.width * p.height + pixel], target, true};
}

// Filters kRun neighbouring outputs with the 11 taps, from 14 inputs that are each loaded once.
template <class Load>
__device__ void FilterRun(const LossParams& p, Load&& load, float (&out)[kRun]) {
  float in[kRun + 2 * kSsimRadius];
#pragma unroll
  for (int k = 0; k < kRun + 2 * kSsimRadius; ++k) in[k] = load(k);
#pragma unroll
  for (int i = 0; i < kRun; ++i) {
    out[i] = p.taps[0] * in[i + kSsimRadius];
#pragma unroll
    for (int k = 1; k <= kSsimRadius; ++k) {
      out[i] += p.taps[k] * (in[i + kSsimRadius - k] + in[i + kSsimRadius + k]);
    }
  }
}

// Shared memory of MomentKernel.
struct MomentTile {
  float x[kWide][kPitch], y[kWide][kPitch];
  alignas(16) float filtered[kNumMoments][kWide][kTile];
};

// Filters all moments along x, for the scanlines of the margins, too. A thread takes runs of kRun
// outputs.
__device__ void FilterAcross(const LossParams& p, MomentTile& tile) {
  constexpr int kRuns = kTile / kRun;
  for (int item = static_cast<int>(threadIdx.x); item < kWide * kRuns; item += kBlock) {
    const int row = item / kRuns, first = item % kRuns * kRun;
    const float *x = &tile.x[row][first], *y = &tile.y[row][first];
    float out[kNumMoments][kRun];
    FilterRun(
        p, [&](int k) { return x[k]; }, out[0]);
    FilterRun(
        p, [&](int k) { return y[k]; }, out[1]);
    FilterRun(
        p, [&](int k) { return x[k] * x[k] + y[k] * y[k]; }, out[2]);
    FilterRun(
        p, [&](int k) { return x[k] * y[k]; }, out[3]);
#pragma unroll
    for (int m = 0; m < kNumMoments; ++m) {
      *reinterpret_cast<float4*>(&tile.filtered[m][row][first]) = {out[m][0], out[m][1], out[m][2],
                                                                   out[m][3]};
    }
  }
}

// Adds the sums of the block's threads in a fixed order and stores them. Called by all threads.
__device__ void StorePartials(const LossParams& p, const float (&own)[3]) {
  __shared__ float warps[3][kBlock / 32];
  const int lane = static_cast<int>(threadIdx.x) % 32, warp = static_cast<int>(threadIdx.x) / 32;
#pragma unroll
  for (int k = 0; k < 3; ++k) {
    float sum = own[k];
    for (int offset = 16; offset > 0; offset /= 2) sum += __shfl_xor_sync(~0u, sum, offset);
    if (lane == 0) warps[k][warp] = sum;
  }
  __syncthreads();
  if (threadIdx.x >= 3) return;
  double sum = 0;
  for (int w = 0; w < kBlock / 32; ++w) sum += warps[threadIdx.x][w];
  const int64_t block = (int64_t{blockIdx.z} * gridDim.y + blockIdx.y) * gridDim.x + blockIdx.x;
  p.partials[block * 3 + threadIdx.x] = sum;
}

// blockIdx.z is the channel. An ignored pixel stores zeros in the maps: its window does not count.
__global__ void __launch_bounds__(kBlock) MomentKernel(LossParams p) {
  __shared__ MomentTile tile;
  const int channel = static_cast<int>(blockIdx.z);
  const int first_x = static_cast<int>(blockIdx.x) * kTile;
  const int first_y = static_cast<int>(blockIdx.y) * kTile;
  for (int item = static_cast<int>(threadIdx.x); item < kWide * kWide; item += kBlock) {
    const int row = item / kWide, column = item % kWide;
    const PixelPair pixel =
        LoadPixel(p, channel, first_x + column - kSsimRadius, first_y + row - kSsimRadius);
    tile.x[row][column] = pixel.x;
    tile.y[row][column] = pixel.y;
  }
  __syncthreads();
  FilterAcross(p, tile);
  __syncthreads();

  const int column = static_cast<int>(threadIdx.x) % kTile;
  const int first_row = static_cast<int>(threadIdx.x) / kTile * kRun;
  float moments[kNumMoments][kRun];
#pragma unroll
  for (int m = 0; m < kNumMoments; ++m) {
    FilterRun(
        p, [&](int k) { return tile.filtered[m][first_row + k][column]; }, moments[m]);
  }
  const float weight = -p.ssim_weight / PixelChannels(p);
  const int64_t num_pixels = int64_t{p.width} * p.height;
  float sums[3] = {};
#pragma unroll
  for (int i = 0; i < kRun; ++i) {
    const int x = first_x + column, y = first_y + first_row + i;
    if (x >= p.width || y >= p.height) continue;
    const int64_t pixel = int64_t{y} * p.width + x;
    const bool counts = p.ignore == nullptr || p.ignore[pixel] == 0;
    const SsimMoments<float> m = {moments[0][i], moments[1][i], moments[2][i], moments[3][i]};
    if (counts) {
      const float difference = tile.x[first_row + i + kSsimRadius][column + kSsimRadius] -
                               tile.y[first_row + i + kSsimRadius][column + kSsimRadius];
      sums[kSumL1] += Abs(difference);
      sums[kSumSsim] += Ssim(m);
      sums[kSumSquared] += difference * difference;
    }
    if (p.maps == nullptr) continue;
    const auto grad = SsimVjp(m, counts ? weight : 0.0f);
    float* map = p.maps + channel * num_pixels + pixel;
    map[0] = grad.x;
    map[3 * num_pixels] = grad.sum_squares;
    map[6 * num_pixels] = grad.product;
  }
  StorePartials(p, sums);
}

// Shared memory of LossGradKernel.
struct GradTile {
  float map[kNumMaps][kWide][kPitch];
  alignas(16) float filtered[kNumMaps][kWide][kTile];
};

// Gradient of each pixel. The filter is symmetric, so the sum over the windows that hold a pixel is
// the filtered map at the pixel. The maps already have the weight of SSIM.
__global__ void __launch_bounds__(kBlock) LossGradKernel(LossParams p) {
  __shared__ GradTile tile;
  const int channel = static_cast<int>(blockIdx.z);
  const int first_x = static_cast<int>(blockIdx.x) * kTile;
  const int first_y = static_cast<int>(blockIdx.y) * kTile;
  const int64_t num_pixels = int64_t{p.width} * p.height;
  for (int item = static_cast<int>(threadIdx.x); item < kWide * kWide; item += kBlock) {
    const int row = item / kWide, column = item % kWide;
    const int x = first_x + column - kSsimRadius, y = first_y + row - kSsimRadius;
    const bool inside = x >= 0 && y >= 0 && x < p.width && y < p.height;
    const float* map = p.maps + channel * num_pixels + int64_t{y} * p.width + x;
#pragma unroll
    for (int m = 0; m < kNumMaps; ++m) {
      tile.map[m][row][column] = inside ? map[3 * m * num_pixels] : 0.0f;
    }
  }
  __syncthreads();
  constexpr int kRuns = kTile / kRun;
  for (int item = static_cast<int>(threadIdx.x); item < kWide * kRuns; item += kBlock) {
    const int row = item / kRuns, first = item % kRuns * kRun;
#pragma unroll
    for (int m = 0; m < kNumMaps; ++m) {
      float out[kRun];
      FilterRun(
          p, [&](int k) { return tile.map[m][row][first + k]; }, out);
      *reinterpret_cast<float4*>(&tile.filtered[m][row][first]) = {out[0], out[1], out[2], out[3]};
    }
  }
  __syncthreads();

  const int column = static_cast<int>(threadIdx.x) % kTile;
  const int first_row = static_cast<int>(threadIdx.x) / kTile * kRun;
  float gathered[kNumMaps][kRun];
#pragma unroll
  for (int m = 0; m < kNumMaps; ++m) {
    FilterRun(
        p, [&](int k) { return tile.filtered[m][first_row + k][column]; }, gathered[m]);
  }
  const float l1_weight = p.l1_weight / PixelChannels(p);
#pragma unroll
  for (int i = 0; i < kRun; ++i) {
    const int x = first_x + column, y = first_y + first_row + i;
    if (x >= p.width || y >= p.height) continue;
    const PixelPair pixel = LoadPixel(p, channel, x, y);
    const float sign = pixel.y < pixel.x ? l1_weight : pixel.x < pixel.y ? -l1_weight : 0.0f;
    const SsimMomentsGrad<float> grad = {gathered[0][i], gathered[1][i], gathered[2][i]};
    p.color_grad[channel * num_pixels + int64_t{y} * p.width + x] =
        pixel.counts ? SsimPixelVjp(grad, pixel.x, pixel.y) + sign : 0.0f;
  }
}

__global__ void __launch_bounds__(kBlock)
    CountPixelsKernel(const uint8_t* ignore, int64_t num_pixels, int64_t* num_counted) {
  const int64_t i = int64_t{blockIdx.x} * kBlock + threadIdx.x;
  const int count = __syncthreads_count(i < num_pixels && ignore[i] == 0);
  if (threadIdx.x == 0 && count > 0) {
    atomicAdd(reinterpret_cast<unsigned long long*>(num_counted),
              static_cast<unsigned long long>(count));
  }
}

// Adds the partial sums of all blocks, in a fixed order. One block.
__global__ void __launch_bounds__(kBlock)
    SumPartialsKernel(LossParams p, int num_partials, double* sums) {
  __shared__ double threads[3][kBlock];
  double own[3] = {};
  for (int i = static_cast<int>(threadIdx.x); i < num_partials; i += kBlock) {
    for (int k = 0; k < 3; ++k) own[k] += p.partials[3 * i + k];
  }
  for (int k = 0; k < 3; ++k) threads[k][threadIdx.x] = own[k];
  for (int half = kBlock / 2; half > 0; half /= 2) {
    __syncthreads();
    if (static_cast<int>(threadIdx.x) >= half) continue;
    for (int k = 0; k < 3; ++k) threads[k][threadIdx.x] += threads[k][threadIdx.x + half];
  }
  if (threadIdx.x != 0) return;
  sums[kSumL1] = threads[kSumL1][0];
  sums[kSumSsim] = threads[kSumSsim][0];
  sums[kSumSquared] = threads[kSumSquared][0];
  const int64_t num_counted =
      p.num_counted != nullptr ? *p.num_counted : int64_t{p.width} * p.height;
  sums[kSumPixelChannels] = static_cast<double>(3 * num_counted);
}

}  // namespace

void CudaBackend::ImageLoss(const ImageLossArgs& args) {
  const Turn turn(*this);
  if (!turn) return;
  static_assert(kSumL1 < 3 && kSumSsim < 3 && kSumSquared < 3);
  const int64_t num_pixels = int64_t{args.width} * args.height;
  const dim3 grid(NumBlocks(args.width, kTile), NumBlocks(args.height, kTile), 3);
  const int num_partials = static_cast<int>(grid.x * grid.y * grid.z);
  const bool want_grad = !args.color_grad.empty();
  const size_t partial_bytes = 3 * sizeof(double) * static_cast<size_t>(num_partials);
  const size_t map_bytes = want_grad ? 3 * kNumMaps * sizeof(float) * num_pixels : 0;
  auto* memory = static_cast<std::byte*>(Temporary(sizeof(int64_t) + partial_bytes + map_bytes));
  if (!error_.empty() || num_pixels == 0) return;
  auto* num_counted = reinterpret_cast<int64_t*>(memory);
  auto* partials = reinterpret_cast<double*>(memory + sizeof(int64_t));
  LossParams params = {args.width,
                       args.height,
                       args.color.data,
                       args.target.data,
                       args.ignore.data,
                       nullptr,
                       1 - args.ssim_weight,
                       args.ssim_weight,
                       {},
                       nullptr,
                       partials,
                       args.color_grad.data};
  for (int k = 0; k <= kSsimRadius; ++k) params.taps[k] = static_cast<float>(kSsimTaps[k]);
  if (want_grad) {
    params.maps = reinterpret_cast<float*>(memory + sizeof(int64_t) + partial_bytes);
  }
  if (!args.ignore.empty()) {
    params.num_counted = num_counted;
    Zero(num_counted, sizeof(int64_t));
    CountPixelsKernel<<<NumBlocks(num_pixels, kBlock), kBlock, 0, stream_>>>(
        args.ignore.data, num_pixels, num_counted);
    Launched("count pixels");
  }
  MomentKernel<<<grid, kBlock, 0, stream_>>>(params);
  Launched("loss moments");
  SumPartialsKernel<<<1, kBlock, 0, stream_>>>(params, num_partials, args.sums.data);
  Launched("loss sums");
  if (!want_grad) return;
  LossGradKernel<<<grid, kBlock, 0, stream_>>>(params);
  Launched("loss gradient");
}

}  // namespace pepeseg
