#include <cuda_fp16.h>
#include <cuda_runtime.h>

#include <cstdint>

#include "kernels/cuda/cuda_backend.h"
#include "kernels/cuda/half_tiles.cuh"
#include "kernels/ops/prompt_network.h"

// AttendToPlaces and UpdatePlaces (kernels/ops/prompt_network.h) on the tensor cores. Both walk
// over places in tiles of 64: a block has four warps, a warp has 16 places. Rows of tokens come in
// groups of 64: all eight heads of 8 slots, or four heads of 16.
//
// Places are the rows of a in MultiplyHalves: lane 4i + j has, of places i and i + 8, the channels
// 8j to 8j + 7 of each 32, and the scores with two rows of each tile of 8 rows. Where a head has 8
// slots, its scores for a place are a tile, in four lanes.
//
// AttendKernel: a block has a part of the places of a prompt and a group. Shared memory: the
// group's rows; the tile's places; weights of the tile [64 places, 64 rows]; the largest scores.
// The sums [64 rows, 256] are in registers, 64 channels a warp, and are rescaled when a score
// exceeds the largest (online softmax). A tile has four phases, separated by __syncthreads: scores
// by place and the largest of each warp; the largest of the block (64 threads, a row each); weights
// by place; sums by channel. Parts are merged by UpdateTokens, in their order.
//
// UpdateKernel: a block has 256 places of a prompt, four tiles. Shared memory: keys and values of a
// group. A warp needs nothing of the other warps: its 16 places with 256 channels each are in
// registers as floats from the sum to the LayerNorm.

namespace pepeseg {
namespace {

constexpr int kBlock = 128, kWarps = kBlock / 32;
constexpr int kTile = 16 * kWarps;  // places
constexpr int kGroup = 64;          // rows
constexpr int kChunks = kPromptChannels / 32;
constexpr int kRowTiles = kGroup / 8;
constexpr int kWords = kPromptChannels / 8;  // uint4 of a place or row
constexpr int kRowStride = ChunkStride(kPromptChannels);
constexpr int kPlaceStride = MatrixStride(kPromptChannels);
constexpr int kWeightStride = MatrixStride(kGroup);

struct AttendParams {
  const uint4* places;
  int64_t prompt_stride;  // uint4 from the places of a prompt to those of the next; 0: shared
  const uint4* positions;
  const uint4* rows;
  int num_rows, part_size;
  float *sums, *best, *total;
};

struct AttendShared {
  __half rows[kGroup * kRowStride];
  __half places[kTile * kPlaceStride];
  __half weights[kTile * kWeightStride];
  float warp_best[kWarps][kGroup];
  float best[kGroup];   // largest score so far
  float scale[kGroup];  // of the sums before this tile
};

// Computes the scores of a warp's 16 places with a group of rows. place: at the lane's channels of
// the warp's place i; keep: where to copy the places to, in the same way, or null.
__device__ void Scores(const uint4* place, const uint4* position, const __half* rows, int lane,
                       __half* keep, float (&score)[kRowTiles][4]) {
  for (auto& tile : score) tile[0] = tile[1] = tile[2] = tile[3] = 0;
  const __half* row = rows + lane / 4 * kRowStride + lane % 4 * 8;
#pragma unroll
  for (int chunk = 0; chunk < kChunks; ++chunk) {
    uint4 low = place[chunk * 4], high = place[8 * kWords + chunk * 4];
    if (keep != nullptr) {
      *reinterpret_cast<uint4*>(keep + chunk * 32) = low;
      *reinterpret_cast<uint4*>(keep + 8 * kPlaceStride + chunk * 32) = high;
    }
    low = AddHalves(low, position[chunk * 4]);
    high = AddHalves(high, position[8 * kWords + chunk * 4]);
#pragma unroll
    for (int tile = 0; tile < kRowTiles; ++tile) {
      const uint4 key = *reinterpret_cast<const uint4*>(row + tile * 8 * kRowStride + chunk * 32);
      MultiplyChunk(low, high, key, score[tile]);
    }
  }
}

// The largest of each column of a warp's scores, over its 16 places, to best[kGroup].
__device__ void ColumnBest(const float (&score)[kRowTiles][4], int lane, float* best) {
#pragma unroll
  for (int tile = 0; tile < kRowTiles; ++tile) {
#pragma unroll
    for (int e = 0; e < 2; ++e) {
      float x = fmaxf(score[tile][e], score[tile][e + 2]);
      for (int offset = 4; offset < 32; offset *= 2) {
        x = fmaxf(x, __shfl_xor_sync(~0u, x, offset));
      }
      if (lane < 4) best[8 * tile + 2 * lane + e] = x;
    }
  }
}

// Adds, for a warp's 64 channels, weight times place over the tile's places.
__device__ void AddPlaces(const AttendShared& shared, int warp, int lane, float (&sum)[4][8][4]) {
  const int matrix = lane / 8, line = lane % 8;
#pragma unroll
  for (int step = 0; step < kTile / 16; ++step) {
    uint32_t a[4][4];
    const int place_a = 16 * step + matrix / 2 * 8 + line;
#pragma unroll
    for (int i = 0; i < 4; ++i) {
      LoadTransposed(shared.weights + place_a * kWeightStride + 16 * i + matrix % 2 * 8, a[i]);
    }
    const int place_b = 16 * step + matrix % 2 * 8 + line;
#pragma unroll
    for (int pair = 0; pair < 4; ++pair) {
      uint32_t b[4];
      LoadTransposed(
          shared.places + place_b * kPlaceStride + 64 * warp + 16 * pair + matrix / 2 * 8, b);
#pragma unroll
      for (int i = 0; i < 4; ++i) {
        MultiplyHalves(a[i][0], a[i][1], a[i][2], a[i][3], b[0], b[1], sum[i][2 * pair]);
        MultiplyHalves(a[i][0], a[i][1], a[i][2], a[i][3], b[2], b[3], sum[i][2 * pair + 1]);
      }
    }
  }
}

// Turns scores into weights, which go to shared memory, and adds them to the lane's totals.
__device__ void Weigh(AttendShared& shared, const float (&score)[kRowTiles][4], int warp, int lane,
                      float (&total)[kRowTiles][2]) {
  __half* out = shared.weights + (16 * warp + lane / 4) * kWeightStride + 2 * (lane % 4);
#pragma unroll
  for (int tile = 0; tile < kRowTiles; ++tile) {
    const float2 best = *reinterpret_cast<const float2*>(shared.best + 8 * tile + 2 * (lane % 4));
    const float2 scale = *reinterpret_cast<const float2*>(shared.scale + 8 * tile + 2 * (lane % 4));
    const float a = __expf(score[tile][0] - best.x), b = __expf(score[tile][1] - best.y);
    const float c = __expf(score[tile][2] - best.x), d = __expf(score[tile][3] - best.y);
    total[tile][0] = total[tile][0] * scale.x + (a + c);
    total[tile][1] = total[tile][1] * scale.y + (b + d);
    *reinterpret_cast<uint32_t*>(out + 8 * tile) = PackHalves(a, b);
    *reinterpret_cast<uint32_t*>(out + 8 * kWeightStride + 8 * tile) = PackHalves(c, d);
  }
}

// Writes the group's sums and totals. blockIdx: part, prompt, group.
__device__ void WriteSums(const AttendParams& p, AttendShared& shared, int warp, int lane,
                          const float (&total)[kRowTiles][2], const float (&sum)[4][8][4]) {
#pragma unroll
  for (int tile = 0; tile < kRowTiles; ++tile) {
#pragma unroll
    for (int e = 0; e < 2; ++e) {
      float x = total[tile][e];
      for (int offset = 4; offset < 32; offset *= 2) x += __shfl_xor_sync(~0u, x, offset);
      if (lane < 4) shared.warp_best[warp][8 * tile + 2 * lane + e] = x;
    }
  }
  __syncthreads();
  const int64_t first =
      (int64_t{blockIdx.y} * gridDim.x + blockIdx.x) * p.num_rows + blockIdx.z * kGroup;
  if (const auto row = static_cast<int>(threadIdx.x); row < kGroup) {
    float x = 0;
    for (int w = 0; w < kWarps; ++w) x += shared.warp_best[w][row];
    p.best[first + row] = shared.best[row];
    p.total[first + row] = x;
  }
#pragma unroll
  for (int i = 0; i < 4; ++i) {
#pragma unroll
    for (int tile = 0; tile < 8; ++tile) {
      float* out = p.sums + (first + 16 * i + lane / 4) * kPromptChannels + 64 * warp + 8 * tile +
                   2 * (lane % 4);
      *reinterpret_cast<float2*>(out) = {sum[i][tile][0], sum[i][tile][1]};
      *reinterpret_cast<float2*>(out + 8 * kPromptChannels) = {sum[i][tile][2], sum[i][tile][3]};
    }
  }
}

__global__ void __launch_bounds__(kBlock, 2) AttendKernel(AttendParams p) {
  extern __shared__ uint4 memory[];
  auto& shared = *reinterpret_cast<AttendShared*>(memory);
  const int thread = static_cast<int>(threadIdx.x), warp = thread / 32, lane = thread % 32;
  CopyRows<kPromptChannels, kRowStride>(
      p.rows + (int64_t{blockIdx.y} * p.num_rows + blockIdx.z * kGroup) * kWords, kGroup,
      shared.rows);
  if (thread < kGroup) shared.best[thread] = -INFINITY;
  float sum[4][8][4] = {}, total[kRowTiles][2] = {};
  __syncthreads();
  const int in_tile = 16 * warp + lane / 4;
  for (int tile = 0; tile < p.part_size / kTile; ++tile) {
    const int64_t place = int64_t{blockIdx.x} * p.part_size + tile * kTile + in_tile;
    const int64_t at = place * kWords + lane % 4;
    float score[kRowTiles][4];
    Scores(p.places + blockIdx.y * p.prompt_stride + at, p.positions + at, shared.rows, lane,
           shared.places + in_tile * kPlaceStride + lane % 4 * 8, score);
    ColumnBest(score, lane, shared.warp_best[warp]);
    __syncthreads();
    bool grows = false;
    if (thread < kGroup) {
      const float before = shared.best[thread];
      float best = before;
      for (int w = 0; w < kWarps; ++w) best = fmaxf(best, shared.warp_best[w][thread]);
      grows = best > before;
      shared.best[thread] = best;
      shared.scale[thread] = __expf(before - best);
    }
    const bool rescale = __syncthreads_or(grows) != 0;
    Weigh(shared, score, warp, lane, total);
    if (rescale) {
#pragma unroll
      for (int i = 0; i < 4; ++i) {
        const float low = shared.scale[16 * i + lane / 4];
        const float high = shared.scale[16 * i + 8 + lane / 4];
#pragma unroll
        for (auto& s : sum[i]) {
          s[0] *= low;
          s[1] *= low;
          s[2] *= high;
          s[3] *= high;
        }
      }
    }
    __syncthreads();
    AddPlaces(shared, warp, lane, sum);
    __syncthreads();
  }
  WriteSums(p, shared, warp, lane, total, sum);
}

constexpr int kTilesOfBlock = 4;  // of UpdateKernel
// Accumulator tile 4 c + k of a lane has channels 32 c + 8 j + 2 k and the next: those that the
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

__global__ void AddKernel(const __half2* places, const float2* offsets, int64_t num_offsets,
                          int64_t size, __half2* sum) {
  const int64_t i = int64_t{blockIdx.x} * kBlock + threadIdx.x;
  if (i >= size) return;
  const float2 place = __half22float2(places[i]), offset = offsets[i % num_offsets];
  sum[i] = __floats2half2_rn(place.x + offset.x, place.y + offset.y);
}

int64_t PromptStride(const ConstNetworkSpan& places, int num_places) {
  const int64_t one = int64_t{num_places} * kPromptChannels;
  return places.size == one ? 0 : one / 8;
}
const uint4* Words(const ConstNetworkSpan& span) { return static_cast<const uint4*>(span.data); }

}  // namespace

void CudaBackend::AddToPlaces(const AddToPlacesArgs& args) {
  const Turn turn(*this);
  const int64_t pairs = args.places.size / 2;
  if (!turn || pairs == 0) return;
  AddKernel<<<NumBlocks(pairs, kBlock), kBlock, 0, stream_>>>(
      static_cast<const __half2*>(args.places.data),
      reinterpret_cast<const float2*>(args.offsets.data), args.offsets.size / 2, pairs,
      static_cast<__half2*>(args.sum.data));
  Launched("add to places");
}

void CudaBackend::AttendToPlaces(const AttendToPlacesArgs& args) {
  const Turn turn(*this);
  if (!turn || args.num_prompts == 0) return;
  const int num_rows = TokenRows(args.num_tokens), num_parts = PlaceParts(args.num_places);
  Keep(cudaFuncSetAttribute(AttendKernel, cudaFuncAttributeMaxDynamicSharedMemorySize,
                            sizeof(AttendShared)),
       "reserving shared memory");
  AttendKernel<<<dim3(num_parts, args.num_prompts, num_rows / kGroup), kBlock, sizeof(AttendShared),
                 stream_>>>({Words(args.places), PromptStride(args.places, args.num_places),
                             Words(args.positions), Words(args.rows), num_rows,
                             args.num_places / num_parts, args.sums.sums.data, args.sums.best.data,
                             args.sums.total.data});
  Launched("attend to places");
}

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
