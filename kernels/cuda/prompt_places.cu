#include <cuda_fp16.h>
#include <cuda_runtime.h>

#include <cstdint>

#include "kernels/cuda/cuda_backend.h"
#include "kernels/cuda/prompt_places.cuh"
#include "kernels/ops/prompt_network.h"

// AddToPlaces and AttendToPlaces (kernels/ops/prompt_network.h) on the tensor cores; see
// prompt_places.cuh.
//
// AttendKernel: a block owns a part of the places of a prompt and a group. Shared memory: the
// group's rows; the tile's places; weights of the tile [64 places, 64 rows]; the largest scores.
// The sums [64 rows, 256] are in registers, 64 channels per warp, and are rescaled when a score
// exceeds the largest (online softmax). A tile has four phases, separated by __syncthreads: scores
// by place and the largest of each warp; the largest of the block (64 threads, a row each); weights
// by place; sums by channel. Parts are merged by UpdateTokens, in their order.

namespace pepeseg {
namespace {

using namespace prompt_places;  // NOLINT(google-build-using-namespace)

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
        MultiplyHalves(a[i], b[0], b[1], sum[i][2 * pair]);
        MultiplyHalves(a[i], b[2], b[3], sum[i][2 * pair + 1]);
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

__global__ void AddKernel(const __half2* places, const float2* offsets, int64_t num_offsets,
                          int64_t size, __half2* sum) {
  const int64_t i = int64_t{blockIdx.x} * kBlock + threadIdx.x;
  if (i >= size) return;
  const float2 place = __half22float2(places[i]), offset = offsets[i % num_offsets];
  sum[i] = __floats2half2_rn(place.x + offset.x, place.y + offset.y);
}

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

}  // namespace pepeseg
