#include <cuda_fp16.h>
#include <cuda_runtime.h>

#include <cstdint>

#include "kernels/cuda/cuda_backend.h"
#include "kernels/cuda/half_layer.cuh"
#include "kernels/cuda/half_tiles.cuh"
#include "kernels/ops/prompt_network.h"

// UpdateTokens (kernels/ops/prompt_network.h).
//
// UpdateKernel: one block per prompt, whose up to 16 tokens are the rows of a in MultiplyHalves,
// and eight warps, each of which owns a head where heads are separate. Weights are read from global
// memory, where they stay in the L2 cache for all prompts. Shared memory:
//   tokens  [16, 256] float, with rows of zeros after the last token
//   input   [16, 256] half, factors of the next product
//   large   the mean places of rows, the hidden channels of the MLP, or query, key and value of the
//           attention among tokens: one after the other
// Each function below ends with __syncthreads where it writes shared memory.

namespace pepeseg {
namespace {

constexpr int kBlock = 256, kWarps = kBlock / 32;
static_assert(kWarps == kPromptHeads);
constexpr int kSize = kPromptChannels;
constexpr int kInputStride = ChunkStride(kSize), kHiddenStride = ChunkStride(kMlpChannels);
constexpr int kMixStride = kSize + 4;  // floats, of query, key and value
constexpr int kMaxRows = kPromptHeads * kMaxTokens;

struct TokenShared {
  float tokens[kMaxTokens * kSize];
  __half input[kMaxTokens * kInputStride];
  union {
    __half means[kMaxRows * kInputStride];
    __half hidden[kMaxTokens * kHiddenStride];
    float mix[3][kMaxTokens * kMixStride];
  };
};

struct TokenParams {
  int num_tokens, slots;
  const float* encoding;
  float* tokens;
  struct {
    const float *sums, *best, *total;
    int num_parts;
    HalfLayer value, out;
    const float *scale, *shift;
  } cross;
  struct {
    HalfLayer in, out;
    const float *scale, *shift;
  } mlp;
  struct {
    HalfLayer key, value;
    const __half *query, *out;
    const float* query_bias;
    __half *keys, *values;
    float* bias;
  } places;
  struct {
    bool is_first;
    HalfLayer query, key, value, out;
    const float *scale, *shift;
  } self;
  struct {
    HalfLayer query;
    const __half* key;
    __half* rows;
  } query;
};

// Computes tile columns of x weight^T + bias and passes them on: write(row, column, a, b) gets
// columns `column` and the next. x: 16 rows in shared memory; weight: [8 num_tiles, kColumns]. The
// calling warp takes every `stride`th tile from `first` on. Two tiles at a time share the loads
// of x.
template <int kColumns, class Write>
__device__ void LinearTiles(const __half* x, int x_stride, const HalfLayer& linear, int first,
                            int num_tiles, int stride, Write write) {
  const int lane = static_cast<int>(threadIdx.x) % 32, i = lane / 4, j = lane % 4;
  const __half* low = x + i * x_stride + 8 * j;
  const __half* high = low + 8 * x_stride;
  for (int tile = first; tile < num_tiles; tile += 2 * stride) {
    const int other = tile + stride < num_tiles ? tile + stride : tile;
    const __half* row = linear.weight + (8 * tile + i) * kColumns + 8 * j;
    const __half* other_row = linear.weight + (8 * other + i) * kColumns + 8 * j;
    float sum[4] = {}, other_sum[4] = {};
#pragma unroll 8
    for (int chunk = 0; chunk < kColumns; chunk += 32) {
      const uint4 a = *reinterpret_cast<const uint4*>(low + chunk);
      const uint4 b = *reinterpret_cast<const uint4*>(high + chunk);
      MultiplyChunk(a, b, __ldg(reinterpret_cast<const uint4*>(row + chunk)), sum);
      MultiplyChunk(a, b, __ldg(reinterpret_cast<const uint4*>(other_row + chunk)), other_sum);
    }
    const auto pass_on = [&](int at, const float(&s)[4]) {
      const int column = 8 * at + 2 * j;
      const float b0 = linear.bias[column], b1 = linear.bias[column + 1];
      write(i, column, s[0] + b0, s[1] + b1);
      write(i + 8, column, s[2] + b0, s[3] + b1);
    };
    pass_on(tile, sum);
    if (other != tile) pass_on(other, other_sum);
  }
}

// All tiles of a layer, spread over the block's warps.
template <int kColumns, class Write>
__device__ void LinearRows(const __half* x, int x_stride, const HalfLayer& linear, int num_out,
                           Write write) {
  LinearTiles<kColumns>(x, x_stride, linear, static_cast<int>(threadIdx.x) / 32, num_out / 8,
                        kWarps, write);
  __syncthreads();
}

// Writes a pair of columns as halves to rows of shared memory.
__device__ inline void PutHalves(__half* rows, int stride, int row, int column, float a, float b) {
  *reinterpret_cast<uint32_t*>(rows + row * stride + column) = PackHalves(a, b);
}

// input = the tokens, plus their encoding if asked for.
__device__ void StageTokens(const TokenParams& p, bool with_encoding, TokenShared& shared) {
  const float* encoding = p.encoding + int64_t{blockIdx.x} * p.num_tokens * kSize;
  for (int i = 2 * static_cast<int>(threadIdx.x); i < kMaxTokens * kSize; i += 2 * kBlock) {
    float2 x = *reinterpret_cast<const float2*>(shared.tokens + i);
    if (with_encoding && i < p.num_tokens * kSize) {
      const float2 e = *reinterpret_cast<const float2*>(encoding + i);
      x = {x.x + e.x, x.y + e.y};
    }
    PutHalves(shared.input, kInputStride, i / kSize, i % kSize, x.x, x.y);
  }
  __syncthreads();
}

// Adds the layer's outputs to the tokens, or replaces the tokens by them, and normalises. A warp
// normalises two tokens.
template <int kColumns>
__device__ void AddAndNormalize(const __half* x, int x_stride, const HalfLayer& linear,
                                const float* scale, const float* shift, bool replace,
                                TokenShared& shared) {
  LinearRows<kColumns>(x, x_stride, linear, kSize, [&](int row, int column, float a, float b) {
    auto* token = reinterpret_cast<float2*>(shared.tokens + row * kSize + column);
    const float2 before = replace ? float2{0, 0} : *token;
    *token = {before.x + a, before.y + b};
  });
  const int warp = static_cast<int>(threadIdx.x) / 32, lane = static_cast<int>(threadIdx.x) % 32;
  for (int row = warp; row < kMaxTokens; row += kWarps) {
    float x[kSize / 32], sum = 0, squares = 0;
    for (int k = 0; k < kSize / 32; ++k) {
      x[k] = shared.tokens[row * kSize + lane + 32 * k];
      sum += x[k];
    }
    for (int offset = 16; offset > 0; offset /= 2) sum += __shfl_xor_sync(~0u, sum, offset);
    const float mean = sum * (1.0f / kSize);
    for (const float value : x) squares += (value - mean) * (value - mean);
    for (int offset = 16; offset > 0; offset /= 2) squares += __shfl_xor_sync(~0u, squares, offset);
    const float inverse = rsqrtf(squares * (1.0f / kSize) + 1e-5f);
    for (int k = 0; k < kSize / 32; ++k) {
      const int column = lane + 32 * k;
      shared.tokens[row * kSize + column] = (x[k] - mean) * inverse * scale[column] + shift[column];
    }
  }
  __syncthreads();
}

// Merges the parts of each row's sums into the mean place. A warp takes a row at a time, a lane
// eight channels.
__device__ void MergeParts(const TokenParams& p, TokenShared& shared) {
  const int warp = static_cast<int>(threadIdx.x) / 32, lane = static_cast<int>(threadIdx.x) % 32;
  const int num_rows = kPromptHeads * p.slots;
  for (int row = warp; row < num_rows; row += kWarps) {
    const int64_t first = int64_t{blockIdx.x} * p.cross.num_parts * num_rows + row;
    float best = -INFINITY, total = 0, mean[8] = {};
    for (int part = 0; part < p.cross.num_parts; ++part) {
      best = fmaxf(best, p.cross.best[first + part * num_rows]);
    }
    for (int part = 0; part < p.cross.num_parts; ++part) {
      const int64_t at = first + part * num_rows;
      const float scale = __expf(p.cross.best[at] - best);
      total += scale * p.cross.total[at];
      const auto* sums = reinterpret_cast<const float4*>(p.cross.sums + at * kSize + 8 * lane);
      const float4 a = sums[0], b = sums[1];
      const float values[8] = {a.x, a.y, a.z, a.w, b.x, b.y, b.z, b.w};
      for (int k = 0; k < 8; ++k) mean[k] += scale * values[k];
    }
    const float inverse = 1 / total;
    for (int k = 0; k < 8; k += 2) {
      PutHalves(shared.means, kInputStride, row, 8 * lane + k, mean[k] * inverse,
                mean[k + 1] * inverse);
    }
  }
  __syncthreads();
}

// A warp projects the mean places of its head. Its 16 rows include those of the next head where a
// head has 8 slots; their outputs are left out.
__device__ void EndCross(const TokenParams& p, TokenShared& shared) {
  MergeParts(p, shared);
  const int head = static_cast<int>(threadIdx.x) / 32;
  constexpr int kTiles = kCrossSize / 8;
  LinearTiles<kSize>(
      shared.means + head * p.slots * kInputStride, kInputStride, p.cross.value, head * kTiles,
      (head + 1) * kTiles, 1, [&](int row, int column, float a, float b) {
        const bool used = row < p.num_tokens;
        PutHalves(shared.input, kInputStride, row, column, used ? a : 0, used ? b : 0);
      });
  __syncthreads();
  AddAndNormalize<kCrossChannels>(shared.input, kInputStride, p.cross.out, p.cross.scale,
                                  p.cross.shift, false, shared);
}

__device__ void RunMlp(const TokenParams& p, TokenShared& shared) {
  StageTokens(p, false, shared);
  LinearRows<kSize>(shared.input, kInputStride, p.mlp.in, kMlpChannels,
                    [&](int row, int column, float a, float b) {
                      PutHalves(shared.hidden, kHiddenStride, row, column, fmaxf(a, 0),
                                fmaxf(b, 0));
                    });
  AddAndNormalize<kMlpChannels>(shared.hidden, kHiddenStride, p.mlp.out, p.mlp.scale, p.mlp.shift,
                                false, shared);
}

// Projects the input to kCrossChannels, in place of the input's first columns.
__device__ void Project(const HalfLayer& linear, TokenShared& shared) {
  // All warps read the whole input, so the outputs wait in `mix`.
  LinearRows<kSize>(
      shared.input, kInputStride, linear, kCrossChannels,
      [&](int row, int column, float a, float b) {
        *reinterpret_cast<float2*>(&shared.mix[0][row * kMixStride + column]) = {a, b};
      });
  for (int i = 2 * static_cast<int>(threadIdx.x); i < kMaxTokens * kCrossChannels;
       i += 2 * kBlock) {
    const int row = i / kCrossChannels, column = i % kCrossChannels;
    const float* x = &shared.mix[0][row * kMixStride + column];
    PutHalves(shared.input, kInputStride, row, column, x[0], x[1]);
  }
  __syncthreads();
}

// Writes scale times matrix, [256, 128], times the head's part of each projected token: rows of the
// warp's head. The four factors of a lane are neighbours: their order does not matter.
__device__ void Fold(const TokenParams& p, const __half* matrix, float scale, __half* out,
                     TokenShared& shared) {
  const int head = static_cast<int>(threadIdx.x) / 32, lane = static_cast<int>(threadIdx.x) % 32;
  const int i = lane / 4, j = lane % 4;
  const __half* x = shared.input + i * kInputStride + head * kCrossSize + 4 * j;
  const uint2 low = *reinterpret_cast<const uint2*>(x);
  const uint2 high = *reinterpret_cast<const uint2*>(x + 8 * kInputStride);
  __half* row =
      out + (int64_t{blockIdx.x} * kPromptHeads + head) * p.slots * kSize + i * kSize + 2 * j;
#pragma unroll 8
  for (int tile = 0; tile < kSize / 8; ++tile) {
    const uint2 b = __ldg(reinterpret_cast<const uint2*>(matrix + (8 * tile + i) * kCrossChannels +
                                                         head * kCrossSize + 4 * j));
    float sum[4] = {};
    MultiplyHalves(low.x, high.x, low.y, high.y, b.x, b.y, sum);
    const bool used[2] = {i < p.num_tokens, i + 8 < p.num_tokens};
    *reinterpret_cast<uint32_t*>(row + 8 * tile) =
        used[0] ? PackHalves(scale * sum[0], scale * sum[1]) : 0;
    if (p.slots == 16) {
      *reinterpret_cast<uint32_t*>(row + 8 * kSize + 8 * tile) =
          used[1] ? PackHalves(scale * sum[2], scale * sum[3]) : 0;
    }
  }
  __syncthreads();
}

constexpr float kCrossScale = 0.25f;  // 1 / sqrt(kCrossSize)

__device__ void FoldPlaces(const TokenParams& p, TokenShared& shared) {
  StageTokens(p, true, shared);
  Project(p.places.key, shared);
  const int num_rows = kPromptHeads * p.slots;
  for (int row = static_cast<int>(threadIdx.x); row < num_rows; row += kBlock) {
    const int head = row / p.slots, token = row % p.slots;
    float bias = 0;
    for (int k = head * kCrossSize; k < (head + 1) * kCrossSize; ++k) {
      bias += p.places.query_bias[k] * __half2float(shared.input[token * kInputStride + k]);
    }
    p.places.bias[int64_t{blockIdx.x} * num_rows + row] =
        token < p.num_tokens ? kCrossScale * bias : -INFINITY;
  }
  Fold(p, p.places.query, kCrossScale, p.places.keys, shared);
  StageTokens(p, false, shared);
  Project(p.places.value, shared);
  Fold(p, p.places.out, 1, p.places.values, shared);
}

// The attention of the warp's head: a token at a time. A lane first has another token, then a
// channel.
__device__ void MixHead(int num_tokens, TokenShared& shared) {
  const int head = static_cast<int>(threadIdx.x) / 32, lane = static_cast<int>(threadIdx.x) % 32;
  const float *query = shared.mix[0] + head * kSelfSize, *key = shared.mix[1] + head * kSelfSize,
              *value = shared.mix[2] + head * kSelfSize;
  for (int token = 0; token < kMaxTokens; ++token) {
    float score = -INFINITY, mixed = 0;
    if (lane < num_tokens) {
      score = 0;
      for (int c = 0; c < kSelfSize; ++c) {
        score += query[token * kMixStride + c] * key[lane * kMixStride + c];
      }
      score *= 0.17677670f;  // 1 / sqrt(kSelfSize)
    }
    float best = score;
    for (int offset = 16; offset > 0; offset /= 2) {
      best = fmaxf(best, __shfl_xor_sync(~0u, best, offset));
    }
    const float weight = __expf(score - best);
    float total = weight;
    for (int offset = 16; offset > 0; offset /= 2) total += __shfl_xor_sync(~0u, total, offset);
    for (int other = 0; other < num_tokens; ++other) {
      mixed += __shfl_sync(~0u, weight, other) * value[other * kMixStride + lane];
    }
    shared.input[token * kInputStride + head * kSelfSize + lane] = __float2half_rn(mixed / total);
  }
  __syncthreads();
}

__device__ void AttendToTokens(const TokenParams& p, TokenShared& shared) {
  const auto project = [&](const HalfLayer& linear, int to) {
    LinearRows<kSize>(
        shared.input, kInputStride, linear, kSize, [&](int row, int column, float a, float b) {
          *reinterpret_cast<float2*>(&shared.mix[to][row * kMixStride + column]) = {a, b};
        });
  };
  StageTokens(p, !p.self.is_first, shared);
  project(p.self.query, 0);
  project(p.self.key, 1);
  StageTokens(p, false, shared);
  project(p.self.value, 2);
  MixHead(p.num_tokens, shared);
  AddAndNormalize<kSize>(shared.input, kInputStride, p.self.out, p.self.scale, p.self.shift,
                         p.self.is_first, shared);
}

__global__ void __launch_bounds__(kBlock) UpdateKernel(TokenParams p) {
  extern __shared__ uint4 memory[];
  auto& shared = *reinterpret_cast<TokenShared*>(memory);
  float* tokens = p.tokens + int64_t{blockIdx.x} * p.num_tokens * kSize;
  for (int i = static_cast<int>(threadIdx.x); i < kMaxTokens * kSize; i += kBlock) {
    shared.tokens[i] = i < p.num_tokens * kSize ? tokens[i] : 0;
  }
  __syncthreads();
  if (p.cross.value.weight != nullptr) EndCross(p, shared);
  if (p.mlp.in.weight != nullptr) RunMlp(p, shared);
  if (p.places.key.weight != nullptr) FoldPlaces(p, shared);
  if (p.self.query.weight != nullptr) AttendToTokens(p, shared);
  if (p.query.query.weight != nullptr) {
    StageTokens(p, true, shared);
    Project(p.query.query, shared);
    Fold(p, p.query.key, kCrossScale, p.query.rows, shared);
  }
  for (int i = static_cast<int>(threadIdx.x); i < p.num_tokens * kSize; i += kBlock) {
    tokens[i] = shared.tokens[i];
  }
}

}  // namespace

void CudaBackend::UpdateTokens(const UpdateTokensArgs& args) {
  const Turn turn(*this);
  if (!turn || args.num_prompts == 0) return;
  const CrossAttentionEnd& cross = args.cross;
  const PlacesFold& places = args.places;
  const SelfAttention& self = args.self;
  TokenParams p = {};
  p.num_tokens = args.num_tokens;
  p.slots = TokenSlots(args.num_tokens);
  p.encoding = args.encoding.data;
  p.tokens = args.tokens.data;
  p.cross = {cross.sums.sums.data,  cross.sums.best.data, cross.sums.total.data,
             cross.num_parts,       LayerOf(cross.value), LayerOf(cross.out),
             cross.norm.scale.data, cross.norm.shift.data};
  p.mlp = {LayerOf(args.mlp.in), LayerOf(args.mlp.out), args.mlp.norm.scale.data,
           args.mlp.norm.shift.data};
  p.places = {LayerOf(places.key),   LayerOf(places.value),  Halves(places.query),
              Halves(places.out),    places.query_bias.data, Halves(places.keys),
              Halves(places.values), places.bias.data};
  p.self = {self.is_first,     LayerOf(self.query),  LayerOf(self.key),   LayerOf(self.value),
            LayerOf(self.out), self.norm.scale.data, self.norm.shift.data};
  p.query = {LayerOf(args.query.query), Halves(args.query.key), Halves(args.query.rows)};
  Keep(cudaFuncSetAttribute(UpdateKernel, cudaFuncAttributeMaxDynamicSharedMemorySize,
                            sizeof(TokenShared)),
       "reserving shared memory");
  UpdateKernel<<<args.num_prompts, kBlock, sizeof(TokenShared), stream_>>>(p);
  Launched("update tokens");
}

}  // namespace pepeseg
