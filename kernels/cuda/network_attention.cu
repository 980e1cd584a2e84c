#include <cuda_runtime.h>

#include "kernels/cuda/cuda_backend.h"
#include "kernels/cuda/network_tile.cuh"

// WindowAttention (kernels/ops/network.h). A block owns up to 64 queries of one head of one window.
//
// HalfKernel: keys and values of the window lie in shared memory, and each of the four warps has 16
// queries. Their scores with all keys stay in registers, as a softmax over rows that four lanes
// share, and become the left matrix of the product with the values as they are.
//
// FloatKernel, the exact mode: one thread per query. Keys and values pass through shared memory 64
// at a time; the softmax rescales its sums when a larger score comes.

namespace pepeseg {
namespace {

constexpr int kQueries = 64;  // of a block
constexpr int kPitch = kHeadSize + 8;
constexpr float kLeast = -1e30f;
constexpr float kScale = 0.17677669f;  // 1 / sqrt(kHeadSize)

// kSixteens: keys of a window in units of 16, rounded up.
template <int kSixteens>
__global__ void __launch_bounds__(128) HalfKernel(WindowAttentionArgs args) {
  constexpr int kKeys = kSixteens * 16;
  __shared__ __align__(16) __half queries[kQueries * kPitch], keys[kKeys * kPitch],
      values[kKeys * kPitch];
  const int thread = static_cast<int>(threadIdx.x), lane = thread % 32;
  const int head = static_cast<int>(blockIdx.x) % args.heads;
  const int64_t window = static_cast<int>(blockIdx.x) / args.heads;
  const int first_query = static_cast<int>(blockIdx.y) * kQueries;
  const int pitch = args.heads * 3 * kHeadSize;
  const __half* qkv = static_cast<const __half*>(args.qkv.data) + window * args.tokens * pitch +
                      head * 3 * kHeadSize;
  for (int k = thread; k < kQueries * 4; k += 128) {
    const int token = first_query + k / 4;
    const bool inside = token < args.tokens;
    CopyAsync(queries + k / 4 * kPitch + k % 4 * 8,
              qkv + (inside ? int64_t{token} * pitch + k % 4 * 8 : 0), inside);
  }
  for (int k = thread; k < kKeys * 4; k += 128) {
    const bool inside = k / 4 < args.tokens;
    const __half* from = qkv + (inside ? int64_t{k / 4} * pitch + k % 4 * 8 : 0);
    CopyAsync(keys + k / 4 * kPitch + k % 4 * 8, from + kHeadSize, inside);
    CopyAsync(values + k / 4 * kPitch + k % 4 * 8, from + 2 * kHeadSize, inside);
  }
  CommitCopies();
  WaitForCopies<0>();
  __syncthreads();

  const int warp_query = thread / 32 * 16;
  if (first_query + warp_query >= args.tokens) return;
  const int i = lane / 4, j = lane % 4;
  float scores[2 * kSixteens][4] = {};
#pragma unroll
  for (int k = 0; k < kHeadSize; k += 16) {
    uint32_t q[4];
    LoadMatrices(queries + (warp_query + lane % 16) * kPitch + k + lane / 16 * 8, q);
#pragma unroll
    for (int n = 0; n < kSixteens; ++n) {
      uint32_t b[4];
      LoadMatrices(keys + (n * 16 + lane % 8 + lane / 16 * 8) * kPitch + k + lane / 8 % 2 * 8, b);
      MultiplyHalves(q, b[0], b[1], scores[2 * n]);
      MultiplyHalves(q, b[2], b[3], scores[2 * n + 1]);
    }
  }
  // Rows i and i + 8 of the warp's queries.
  float most[2] = {kLeast, kLeast}, total[2] = {0, 0};
#pragma unroll
  for (int half = 0; half < 2; ++half) {
    const int query = min(first_query + warp_query + i + 8 * half, args.tokens - 1);
    const __half* bias = static_cast<const __half*>(args.bias.data) +
                         (int64_t{head} * args.tokens + query) * args.bias_stride;
#pragma unroll
    for (int n = 0; n < 2 * kSixteens; ++n) {
      // The stride is even, so a pair lies within the row if its first key does.
      const int key = n * 8 + 2 * j;
      float2 pair = {0, 0};
      if (key < args.tokens) {
        pair = __half22float2(*reinterpret_cast<const __half2*>(bias + key));
      }
      float& first = scores[n][2 * half];
      float& second = scores[n][2 * half + 1];
      first = key < args.tokens ? first * kScale + pair.x : kLeast;
      second = key + 1 < args.tokens ? second * kScale + pair.y : kLeast;
      most[half] = fmaxf(most[half], fmaxf(first, second));
    }
    most[half] = fmaxf(most[half], __shfl_xor_sync(~0u, most[half], 1));
    most[half] = fmaxf(most[half], __shfl_xor_sync(~0u, most[half], 2));
#pragma unroll
    for (int n = 0; n < 2 * kSixteens; ++n) {
#pragma unroll
      for (int e = 0; e < 2; ++e) {
        float& score = scores[n][2 * half + e];
        score = __expf(score - most[half]);
        total[half] += score;
      }
    }
    total[half] += __shfl_xor_sync(~0u, total[half], 1);
    total[half] += __shfl_xor_sync(~0u, total[half], 2);
  }
  float sums[kHeadSize / 8][4] = {};
#pragma unroll
  for (int n = 0; n < kSixteens; ++n) {
    const uint32_t p[4] = {PackHalves(scores[2 * n][0], scores[2 * n][1]),
                           PackHalves(scores[2 * n][2], scores[2 * n][3]),
                           PackHalves(scores[2 * n + 1][0], scores[2 * n + 1][1]),
                           PackHalves(scores[2 * n + 1][2], scores[2 * n + 1][3])};
#pragma unroll
    for (int c = 0; c < kHeadSize; c += 16) {
      uint32_t b[4];
      LoadTransposed(values + (n * 16 + lane % 16) * kPitch + c + lane / 16 * 8, b);
      MultiplyHalves(p, b[0], b[1], sums[c / 8]);
      MultiplyHalves(p, b[2], b[3], sums[c / 8 + 1]);
    }
  }
#pragma unroll
  for (int half = 0; half < 2; ++half) {
    const int query = first_query + warp_query + i + 8 * half;
    if (query >= args.tokens) continue;
    __half* out = static_cast<__half*>(args.output.data) +
                  ((window * args.tokens + query) * args.heads + head) * kHeadSize + 2 * j;
    const float inverse = 1.0f / total[half];
#pragma unroll
    for (int c = 0; c < kHeadSize / 8; ++c) {
      *reinterpret_cast<uint32_t*>(out + c * 8) =
          PackHalves(sums[c][2 * half] * inverse, sums[c][2 * half + 1] * inverse);
    }
  }
}

__global__ void __launch_bounds__(kQueries) FloatKernel(WindowAttentionArgs args) {
  __shared__ float keys[kQueries][kHeadSize], values[kQueries][kHeadSize];
  const int thread = static_cast<int>(threadIdx.x);
  const int head = static_cast<int>(blockIdx.x) % args.heads;
  const int64_t window = static_cast<int>(blockIdx.x) / args.heads;
  const int query = static_cast<int>(blockIdx.y) * kQueries + thread;
  const int pitch = args.heads * 3 * kHeadSize;
  const float* qkv = static_cast<const float*>(args.qkv.data) + window * args.tokens * pitch +
                     head * 3 * kHeadSize;
  const bool inside = query < args.tokens;
  const int row = min(query, args.tokens - 1);
  const float* bias = static_cast<const float*>(args.bias.data) +
                      (int64_t{head} * args.tokens + row) * args.bias_stride;
  float q[kHeadSize], sums[kHeadSize] = {};
  LoadValues<kHeadSize>(qkv + int64_t{row} * pitch, q);
  float most = kLeast, total = 0;
  for (int first = 0; first < args.tokens; first += kQueries) {
    const int count = min(kQueries, args.tokens - first);
    __syncthreads();
    for (int k = thread; k < count * kHeadSize; k += kQueries) {
      const float* from = qkv + int64_t{first + k / kHeadSize} * pitch + k % kHeadSize;
      keys[k / kHeadSize][k % kHeadSize] = from[kHeadSize];
      values[k / kHeadSize][k % kHeadSize] = from[2 * kHeadSize];
    }
    __syncthreads();
    for (int key = 0; key < count; ++key) {
      float score = 0;
#pragma unroll
      for (int c = 0; c < kHeadSize; ++c) score += q[c] * keys[key][c];
      score = score * kScale + bias[first + key];
      if (score > most) {
        const float less = expf(most - score);
        total *= less;
#pragma unroll
        for (float& sum : sums) sum *= less;
        most = score;
      }
      const float probability = expf(score - most);
      total += probability;
#pragma unroll
      for (int c = 0; c < kHeadSize; ++c) sums[c] += probability * values[key][c];
    }
  }
  if (!inside) return;
  const float inverse = 1.0f / total;
#pragma unroll
  for (float& sum : sums) sum *= inverse;
  StoreValues<kHeadSize>(sums,
                         static_cast<float*>(args.output.data) +
                             ((window * args.tokens + query) * args.heads + head) * kHeadSize);
}

}  // namespace

void CudaBackend::WindowAttention(const WindowAttentionArgs& args) {
  const Turn turn(*this);
  if (!turn || args.num_windows == 0) return;
  const dim3 blocks(static_cast<unsigned>(args.num_windows * args.heads),
                    NumBlocks(args.tokens, kQueries));
  if (args.qkv.precision == Precision::kFloat) {
    FloatKernel<<<blocks, kQueries, 0, stream_>>>(args);
  } else if (args.tokens <= 64) {
    HalfKernel<4><<<blocks, 128, 0, stream_>>>(args);
  } else {
    HalfKernel<kMaxWindowTokens / 16><<<blocks, 128, 0, stream_>>>(args);
  }
  Launched("window attention");
}

}  // namespace pepeseg
