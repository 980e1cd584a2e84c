#include <cuda_fp16.h>
#include <cuda_runtime.h>

#include <cstdint>

#include "kernels/cuda/cuda_backend.h"
#include "kernels/cuda/half_tiles.cuh"
#include "kernels/math/activation.h"
#include "kernels/ops/prompt_network.h"

// UpscaleMasks (kernels/ops/prompt_network.h) in one kernel: nothing between places and logits is
// stored in global memory.
//
// A block owns 256 places of a prompt, whole rows of the square, and eight warps; a warp owns 16
// places at a time. Transposed convolutions of 2 x 2 with stride 2 do not overlap: each of the four
// quarters of a place is a product with weights of its own. For each quarter the block copies the
// weights of the first convolution to shared memory; a warp computes the 64 channels of its places
// (registers), LayerNorm and GELU, and from them, one after the other, the four parts of the
// quarter with 32 channels each, GELU, and the product with the four masks. All products are on
// the tensor cores; what one leaves in a lane is what the next takes as factor a.
//
// Logits go to shared memory as halves [mask, place, cell], and from there, when all warps are
// done, to bytes, bits and counts: a thread owns four cells of a row of a place, and eight lanes a
// word of bits. Counts are added by atomics on integers.

namespace pepeseg {
namespace {

constexpr int kBlock = 256, kWarps = kBlock / 32;
constexpr int kPlaces = 256;                 // of a block
constexpr int kAtOnce = 16 * kWarps;         // places
constexpr int kWords = kPromptChannels / 8;  // uint4 of a place
constexpr int kChunks = kPromptChannels / 32;
constexpr int kFirstStride = ChunkStride(kPromptChannels);
constexpr int kSecondStride = MatrixStride(kUpscaledChannels);
constexpr int kFirstTiles = kUpscaledChannels / 8, kSecondTiles = kMaskChannels / 8;

struct UpscaleParams {
  int num_places, side, width, height;
  const uint4 *places, *first, *second;
  const float *first_bias, *second_bias, *scale, *shift, *products;
  float* logits;
  uint32_t* quarters;
  uint32_t* bits;
  int32_t* areas;
};

struct UpscaleShared {
  __half first[kUpscaledChannels * kFirstStride];  // of a quarter
  __half second[4 * kMaskChannels * kSecondStride];
  __half logits[kPromptMasks][kPlaces][kCellsPerPlace];
};

// The first convolution of a quarter: its 64 channels of the warp's 16 places.
__device__ void FirstConvolution(const uint4* place, const __half* weight, int lane,
                                 float (&x)[kFirstTiles][4]) {
  for (auto& tile : x) tile[0] = tile[1] = tile[2] = tile[3] = 0;
  const __half* row = weight + lane / 4 * kFirstStride + lane % 4 * 8;
#pragma unroll
  for (int chunk = 0; chunk < kChunks; ++chunk) {
    const uint4 low = place[chunk * 4], high = place[8 * kWords + chunk * 4];
#pragma unroll
    for (int tile = 0; tile < kFirstTiles; ++tile) {
      const uint4 b = *reinterpret_cast<const uint4*>(row + tile * 8 * kFirstStride + chunk * 32);
      MultiplyChunk(low, high, b, x[tile]);
    }
  }
}

// Adds the bias, normalises the 64 channels, and applies GELU.
__device__ void NormalizeQuarter(const UpscaleParams& p, int lane, float (&x)[kFirstTiles][4],
                                 uint32_t (&out)[kFirstTiles][2]) {
#pragma unroll
  for (int tile = 0; tile < kFirstTiles; ++tile) {
    const float2 bias = *reinterpret_cast<const float2*>(p.first_bias + 8 * tile + 2 * (lane % 4));
    x[tile][0] += bias.x;
    x[tile][1] += bias.y;
    x[tile][2] += bias.x;
    x[tile][3] += bias.y;
  }
#pragma unroll
  for (int place = 0; place < 2; ++place) {
    float sum = 0, squares = 0;
#pragma unroll
    for (const auto& tile : x) sum += tile[2 * place] + tile[2 * place + 1];
    const float mean = RowSum(sum) * (1.0f / kUpscaledChannels);
#pragma unroll
    for (const auto& tile : x) {
      const float a = tile[2 * place] - mean, b = tile[2 * place + 1] - mean;
      squares += a * a + b * b;
    }
    const float inverse = rsqrtf(RowSum(squares) * (1.0f / kUpscaledChannels) + 1e-6f);
#pragma unroll
    for (int tile = 0; tile < kFirstTiles; ++tile) {
      const int at = 8 * tile + 2 * (lane % 4);
      const float2 scale = *reinterpret_cast<const float2*>(p.scale + at);
      const float2 shift = *reinterpret_cast<const float2*>(p.shift + at);
      out[tile][place] =
          PackHalves(Gelu((x[tile][2 * place] - mean) * inverse * scale.x + shift.x),
                     Gelu((x[tile][2 * place + 1] - mean) * inverse * scale.y + shift.y));
    }
  }
}

// The second convolution of one part of a quarter, and the product with the masks. products:
// factors b of the lane.
__device__ void PartLogits(const UpscaleParams& p, const __half* weight, int lane,
                           const uint32_t (&x)[kFirstTiles][2], const uint32_t (&products)[4],
                           float (&logit)[4]) {
  float cell[kSecondTiles][4] = {};
  const __half* row = weight + lane % 8 * kSecondStride + lane / 8 * 8;
#pragma unroll
  for (int tile = 0; tile < kSecondTiles; ++tile) {
#pragma unroll
    for (int step = 0; step < 2; ++step) {  // of 32 channels
      uint32_t b[4];
      LoadMatrices(row + 8 * tile * kSecondStride + 32 * step, b);
      const auto& x0 = x[4 * step];
      const auto& x1 = x[4 * step + 1];
      const auto& x2 = x[4 * step + 2];
      const auto& x3 = x[4 * step + 3];
      MultiplyHalves(x0[0], x0[1], x1[0], x1[1], b[0], b[1], cell[tile]);
      MultiplyHalves(x2[0], x2[1], x3[0], x3[1], b[2], b[3], cell[tile]);
    }
  }
  uint32_t a[kSecondTiles][2];
#pragma unroll
  for (int tile = 0; tile < kSecondTiles; ++tile) {
    const float2 bias = *reinterpret_cast<const float2*>(p.second_bias + 8 * tile + 2 * (lane % 4));
    a[tile][0] = PackHalves(Gelu(cell[tile][0] + bias.x), Gelu(cell[tile][1] + bias.y));
    a[tile][1] = PackHalves(Gelu(cell[tile][2] + bias.x), Gelu(cell[tile][3] + bias.y));
  }
  logit[0] = logit[1] = logit[2] = logit[3] = 0;
  MultiplyHalves(a[0][0], a[0][1], a[1][0], a[1][1], products[0], products[1], logit);
  MultiplyHalves(a[2][0], a[2][1], a[3][0], a[3][1], products[2], products[3], logit);
}

// Keeps the logits of two masks and two places; lanes with j >= 2 have the padding of masks.
__device__ void KeepLogits(const UpscaleParams& p, UpscaleShared& shared, int place, int cell,
                           int lane, const float (&logit)[4]) {
  if (lane % 4 >= 2) return;
  const int extent = 4 * p.side;
  for (int e = 0; e < 4; ++e) {
    const int mask = 2 * (lane % 4) + e % 2, local = place + lane / 4 + e / 2 * 8;
    shared.logits[mask][local][cell] = __float2half_rn(logit[e]);
    const int at = static_cast<int>(blockIdx.x) * kPlaces + local;
    if (p.logits == nullptr || at >= p.num_places) continue;
    const int y = at / p.side * 4 + cell / 4, x = at % p.side * 4 + cell % 4;
    p.logits[((int64_t{blockIdx.y} * kPromptMasks + mask) * extent + y) * extent + x] = logit[e];
  }
}

// Writes bytes and bits of a mask and counts its cells.
__device__ void WriteMask(const UpscaleParams& p, const UpscaleShared& shared, int mask) {
  const auto thread = static_cast<int>(threadIdx.x);
  const int64_t mask_at = int64_t{blockIdx.y} * kPromptMasks + mask;
  const int place = static_cast<int>(blockIdx.x) * kPlaces + thread;
  const bool exists = place < p.num_places;
  const int left = place % p.side * 4;
  int over[3] = {};
  for (int row = 0; row < 4; ++row) {
    const int y = place / p.side * 4 + row;
    const uint2 halves = *reinterpret_cast<const uint2*>(&shared.logits[mask][thread][4 * row]);
    const float2 a = UnpackHalves(halves.x), b = UnpackHalves(halves.y);
    const float logit[4] = {a.x, a.y, b.x, b.y};
    uint32_t bytes = 0, bits = 0;
    for (int k = 0; k < 4; ++k) {
      const float limited = fminf(fmaxf(4 * logit[k], -127.0f), 127.0f);
      bytes |= (static_cast<uint32_t>(static_cast<int>(roundf(limited))) & 255u) << (8 * k);
      const bool counted = exists && left + k < p.width && y < p.height;
      bits |= counted && logit[k] > 0 ? 1u << k : 0u;
      for (int t = 0; t < 3; ++t) over[t] += counted && logit[k] > static_cast<float>(t - 1);
    }
    bits <<= 4 * (thread % 8);
    for (int offset = 1; offset < 8; offset *= 2) bits |= __shfl_xor_sync(~0u, bits, offset);
    if (!exists) continue;
    const int64_t word = (mask_at * 4 * p.side + y) * p.side + place % p.side;
    p.quarters[word] = bytes;
    if (thread % 8 == 0) p.bits[word / 8] = bits;
  }
  for (int t = 0; t < 3; ++t) {
    int count = over[t];
    for (int offset = 16; offset > 0; offset /= 2) count += __shfl_xor_sync(~0u, count, offset);
    if (thread % 32 == 0 && count > 0) atomicAdd(p.areas + mask_at * 3 + t, count);
  }
}

__global__ void __launch_bounds__(kBlock, 2) UpscaleKernel(UpscaleParams p) {
  extern __shared__ uint4 memory[];
  auto& shared = *reinterpret_cast<UpscaleShared*>(memory);
  const int warp = static_cast<int>(threadIdx.x) / 32, lane = static_cast<int>(threadIdx.x) % 32;
  CopyRows<kUpscaledChannels, kSecondStride>(p.second, 4 * kMaskChannels, shared.second);
  uint32_t products[4] = {};  // column lane / 4: the mask, padded to 8
  if (lane / 4 < kPromptMasks) {
    const float* from = p.products +
                        (int64_t{blockIdx.y} * kPromptMasks + lane / 4) * kMaskChannels +
                        2 * (lane % 4);
    for (int k = 0; k < 4; ++k) products[k] = PackHalves(from[8 * k], from[8 * k + 1]);
  }
  for (int quarter = 0; quarter < 4; ++quarter) {
    __syncthreads();
    CopyRows<kPromptChannels, kFirstStride>(p.first + quarter * kUpscaledChannels * kWords,
                                            kUpscaledChannels, shared.first);
    __syncthreads();
    for (int place = 16 * warp; place < kPlaces; place += kAtOnce) {
      const int at = static_cast<int>(blockIdx.x) * kPlaces + place;
      if (at >= p.num_places) break;
      const uint4* from =
          p.places + (int64_t{blockIdx.y} * p.num_places + at + lane / 4) * kWords + lane % 4;
      float x[kFirstTiles][4];
      uint32_t middle[kFirstTiles][2];
      FirstConvolution(from, shared.first, lane, x);
      NormalizeQuarter(p, lane, x, middle);
      for (int part = 0; part < 4; ++part) {
        float logit[4];
        PartLogits(p, shared.second + part * kMaskChannels * kSecondStride, lane, middle, products,
                   logit);
        const int cell = (quarter / 2 * 2 + part / 2) * 4 + quarter % 2 * 2 + part % 2;
        KeepLogits(p, shared, place, cell, lane, logit);
      }
    }
  }
  __syncthreads();
  for (int mask = 0; mask < kPromptMasks; ++mask) WriteMask(p, shared, mask);
}

const uint4* Words(const ConstNetworkSpan& span) { return static_cast<const uint4*>(span.data); }

}  // namespace

void CudaBackend::UpscaleMasks(const UpscaleMasksArgs& args) {
  const Turn turn(*this);
  if (!turn || args.num_prompts == 0) return;
  const int num_places = args.side * args.side;
  Zero(args.areas.data, static_cast<size_t>(args.num_prompts) * kPromptMasks * 3 * sizeof(int32_t));
  Keep(cudaFuncSetAttribute(UpscaleKernel, cudaFuncAttributeMaxDynamicSharedMemorySize,
                            sizeof(UpscaleShared)),
       "reserving shared memory");
  UpscaleKernel<<<dim3(NumBlocks(num_places, kPlaces), args.num_prompts), kBlock,
                  sizeof(UpscaleShared), stream_>>>(
      {num_places, args.side, args.width, args.height, Words(args.places), Words(args.first),
       Words(args.second), args.first_bias.data, args.second_bias.data, args.norm.scale.data,
       args.norm.shift.data, args.products.data, args.logits.data,
       reinterpret_cast<uint32_t*>(args.quarters.data), args.bits.data, args.areas.data});
  Launched("upscale masks");
}

}  // namespace pepeseg
