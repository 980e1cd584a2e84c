#include <cuda_fp16.h>
#include <cuda_runtime.h>

#include <cstdint>

#include "kernels/cuda/cuda_backend.h"
#include "kernels/cuda/prompt_places.cuh"
#include "kernels/ops/prompt_network.h"

// UpdatePlaces (kernels/ops/prompt_network.h) on the tensor cores; see prompt_places.cuh.
//
// UpdateKernel: a block owns 256 places of a prompt, four tiles. Shared memory: keys and values of
// a group. A warp needs nothing of the other warps: its 16 places with 256 channels each are in
// registers as floats from the sum to the LayerNorm.

namespace pepeseg {
namespace {

using namespace prompt_places;  // NOLINT(google-build-using-namespace)

constexpr int kTilesOfBlock = 4;  // of UpdateKernel
// Accumulator tile 4 c + k of a lane holds channels 32 c + 8 j + 2 k and the next: those that the
// lane loads and stores at once. The values' columns are permuted in shared memory to match.
constexpr int kChannelTiles = kPromptChannels / 8;

struct UpdateParams {
  const uint4* places;
  int64_t prompt_stride;
  const uint4* positions;
  const uint4* keys;
  const uint4* values;
  const float *bias, *out_bias, *scale, *shift;
  int num_places, num_rows;
  uint4* updated;
};

struct UpdateShared {
  __half keys[kGroup * kRowStride];
  __half values[kGroup * kPlaceStride];
};

// Copies a group's values with permuted columns: those of lane j, 8 j + 2 k, to 8 k + 2 j.
__device__ void CopyValues(const uint4* from, __half* to) {
  for (int i = static_cast<int>(threadIdx.x); i < kGroup * kWords; i += kBlock) {
    const uint4 word = from[i];
    const int chunk = i % kWords / 4, j = i % 4;
    auto* out = reinterpret_cast<uint32_t*>(to + i / kWords * kPlaceStride + 32 * chunk) + j;
    out[0] = word.x;
    out[4] = word.y;
    out[8] = word.z;
    out[12] = word.w;
  }
}

// Turns scores into shares of each head, as factors a of a product over the group's rows.
template <int kSlots>
__device__ void Shares(const float* bias, int lane, float (&score)[kRowTiles][4],
                       uint32_t (&share)[kRowTiles][2]) {
  constexpr int kTilesOfHead = kSlots / 8;
#pragma unroll
  for (int tile = 0; tile < kRowTiles; ++tile) {
    const float2 b = *reinterpret_cast<const float2*>(bias + 8 * tile + 2 * (lane % 4));
    score[tile][0] += b.x;
    score[tile][1] += b.y;
    score[tile][2] += b.x;
    score[tile][3] += b.y;
  }
#pragma unroll
  for (int head = 0; head < kRowTiles; head += kTilesOfHead) {
#pragma unroll
    for (int place = 0; place < 2; ++place) {
      float best = -INFINITY, total = 0;
#pragma unroll
      for (int tile = head; tile < head + kTilesOfHead; ++tile) {
        best = fmaxf(best, fmaxf(score[tile][2 * place], score[tile][2 * place + 1]));
      }
      best = RowMax(best);
#pragma unroll
      for (int tile = head; tile < head + kTilesOfHead; ++tile) {
        for (int e = 2 * place; e < 2 * place + 2; ++e) {
          score[tile][e] = __expf(score[tile][e] - best);
          total += score[tile][e];
        }
      }
      const float inverse = __fdividef(1.0f, RowSum(total));
#pragma unroll
      for (int tile = head; tile < head + kTilesOfHead; ++tile) {
        share[tile][place] =
            PackHalves(score[tile][2 * place] * inverse, score[tile][2 * place + 1] * inverse);
      }
    }
  }
}

// x += share times the group's values.
__device__ void AddValues(const __half* values, const uint32_t (&share)[kRowTiles][2], int lane,
                          float (&x)[kChannelTiles][4]) {
  const int matrix = lane / 8, line = lane % 8;
  const __half* row = values + (matrix % 2 * 8 + line) * kPlaceStride + matrix / 2 * 8;
#pragma unroll
  for (int step = 0; step < kGroup / 16; ++step) {
#pragma unroll
    for (int pair = 0; pair < kChannelTiles / 2; ++pair) {
      uint32_t b[4];
      LoadTransposed(row + 16 * step * kPlaceStride + 16 * pair, b);
      const auto& first = share[2 * step];
      const auto& second = share[2 * step + 1];
      MultiplyHalves(first[0], first[1], second[0], second[1], b[0], b[1], x[2 * pair]);
      MultiplyHalves(first[0], first[1], second[0], second[1], b[2], b[3], x[2 * pair + 1]);
    }
  }
}

// Returns word k of the lane's eight channels, of two floats.
__device__ inline float2 ChannelPair(const float* values, int chunk, int k, int lane) {
  return *reinterpret_cast<const float2*>(values + 32 * chunk + lane % 4 * 8 + 2 * k);
}

// Starts with x = place + out_bias.
__device__ void LoadPlaces(const uint4* place, const float* out_bias, int lane,
                           float (&x)[kChannelTiles][4]) {
#pragma unroll
  for (int chunk = 0; chunk < kChunks; ++chunk) {
    const uint4 low = place[chunk * 4], high = place[8 * kWords + chunk * 4];
    const uint32_t lows[4] = {low.x, low.y, low.z, low.w};
    const uint32_t highs[4] = {high.x, high.y, high.z, high.w};
#pragma unroll
    for (int k = 0; k < 4; ++k) {
      const float2 a = UnpackHalves(lows[k]), b = UnpackHalves(highs[k]);
      const float2 bias = ChannelPair(out_bias, chunk, k, lane);
      float(&tile)[4] = x[4 * chunk + k];
      tile[0] = a.x + bias.x;
      tile[1] = a.y + bias.y;
      tile[2] = b.x + bias.x;
      tile[3] = b.y + bias.y;
    }
  }
}

// Normalises the two places of a lane and stores them.
__device__ void StoreNormalized(const UpdateParams& p, int lane, float (&x)[kChannelTiles][4],
                                uint4* out) {
  float mean[2] = {}, inverse[2] = {};
#pragma unroll
  for (int place = 0; place < 2; ++place) {
    float sum = 0, squares = 0;
#pragma unroll
    for (const auto& tile : x) sum += tile[2 * place] + tile[2 * place + 1];
    mean[place] = RowSum(sum) * (1.0f / kPromptChannels);
#pragma unroll
    for (const auto& tile : x) {
      const float a = tile[2 * place] - mean[place], b = tile[2 * place + 1] - mean[place];
      squares += a * a + b * b;
    }
    inverse[place] = rsqrtf(RowSum(squares) * (1.0f / kPromptChannels) + 1e-5f);
  }
#pragma unroll
  for (int chunk = 0; chunk < kChunks; ++chunk) {
    uint32_t word[2][4];
#pragma unroll
    for (int k = 0; k < 4; ++k) {
      const float2 scale = ChannelPair(p.scale, chunk, k, lane);
      const float2 shift = ChannelPair(p.shift, chunk, k, lane);
      const float(&tile)[4] = x[4 * chunk + k];
#pragma unroll
      for (int place = 0; place < 2; ++place) {
        word[place][k] =
            PackHalves((tile[2 * place] - mean[place]) * inverse[place] * scale.x + shift.x,
                       (tile[2 * place + 1] - mean[place]) * inverse[place] * scale.y + shift.y);
      }
    }
    out[chunk * 4] = {word[0][0], word[0][1], word[0][2], word[0][3]};
    out[8 * kWords + chunk * 4] = {word[1][0], word[1][1], word[1][2], word[1][3]};
  }
}

template <int kSlots>
__global__ void __launch_bounds__(kBlock, 2) UpdateKernel(UpdateParams p) {
  extern __shared__ uint4 memory[];
  auto& shared = *reinterpret_cast<UpdateShared*>(memory);
  constexpr int kGroups = kPromptHeads * kSlots / kGroup;
  const int warp = static_cast<int>(threadIdx.x) / 32, lane = static_cast<int>(threadIdx.x) % 32;
  const int64_t first_row = int64_t{blockIdx.y} * p.num_rows;
  for (int tile = 0; tile < kTilesOfBlock; ++tile) {
    const int place = (static_cast<int>(blockIdx.x) * kTilesOfBlock + tile) * kTile;
    if (place >= p.num_places) return;  // the same for all threads
    const int64_t at = (int64_t{place} + 16 * warp + lane / 4) * kWords + lane % 4;
    const uint4* from = p.places + blockIdx.y * p.prompt_stride + at;
    float x[kChannelTiles][4];
    for (int group = 0; group < kGroups; ++group) {
      if (kGroups > 1 || tile == 0) {
        __syncthreads();
        const int64_t row = first_row + group * kGroup;
        CopyRows<kPromptChannels, kRowStride>(p.keys + row * kWords, kGroup, shared.keys);
        CopyValues(p.values + row * kWords, shared.values);
        __syncthreads();
      }
      float score[kRowTiles][4];
      uint32_t share[kRowTiles][2];
      Scores(from, p.positions + at, shared.keys, lane, nullptr, score);
      Shares<kSlots>(p.bias + first_row + group * kGroup, lane, score, share);
      if (group == 0) LoadPlaces(from, p.out_bias, lane, x);
      AddValues(shared.values, share, lane, x);
    }
    StoreNormalized(p, lane, x, p.updated + int64_t{blockIdx.y} * p.num_places * kWords + at);
  }
}

}  // namespace

void CudaBackend::UpdatePlaces(const UpdatePlacesArgs& args) {
  const Turn turn(*this);
  if (!turn || args.num_prompts == 0) return;
  const auto kernel = TokenSlots(args.num_tokens) == 8 ? UpdateKernel<8> : UpdateKernel<16>;
  Keep(cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize,
                            sizeof(UpdateShared)),
       "reserving shared memory");
  const dim3 grid(NumBlocks(args.num_places, kTile * kTilesOfBlock), args.num_prompts);
  kernel<<<grid, kBlock, sizeof(UpdateShared), stream_>>>(
      {Words(args.places), PromptStride(args.places, args.num_places), Words(args.positions),
       Words(args.keys), Words(args.values), args.bias.data, args.out_bias.data,
       args.norm.scale.data, args.norm.shift.data, args.num_places, TokenRows(args.num_tokens),
       static_cast<uint4*>(args.updated.data)});
  Launched("update places");
}

}  // namespace pepeseg
