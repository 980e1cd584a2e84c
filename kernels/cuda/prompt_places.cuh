#pragma once

#include <cuda_fp16.h>

#include <cstdint>

#include "kernels/cuda/half_tiles.cuh"
#include "kernels/ops/prompt_network.h"

// What AttendToPlaces and UpdatePlaces (kernels/ops/prompt_network.h) share. Both walk over places
// in tiles of 64: a block is four warps, a warp owns 16 places. Rows of tokens come in groups of
// 64: all eight heads of 8 slots, or four heads of 16.
//
// Places are the rows of a in MultiplyHalves: lane 4i + j has, of places i and i + 8, the channels
// 8j to 8j + 7 of each 32, and the scores with two rows of each tile of 8 rows. Where a head has 8
// slots, its scores for a place are a tile, in four lanes.

namespace pepeseg::prompt_places {

inline constexpr int kBlock = 128, kWarps = kBlock / 32;
inline constexpr int kTile = 16 * kWarps;  // places
inline constexpr int kGroup = 64;          // rows
inline constexpr int kChunks = kPromptChannels / 32;
inline constexpr int kRowTiles = kGroup / 8;
inline constexpr int kWords = kPromptChannels / 8;  // uint4 of a place or row
inline constexpr int kRowStride = ChunkStride(kPromptChannels);
inline constexpr int kPlaceStride = MatrixStride(kPromptChannels);

// Computes the scores of a warp's 16 places with a group of rows. place: at the lane's channels of
// the warp's place i; keep: where to copy the places to, in the same way, or null.
__device__ inline void Scores(const uint4* place, const uint4* position, const __half* rows,
                              int lane, __half* keep, float (&score)[kRowTiles][4]) {
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

// Returns the uint4 from the places of a prompt to those of the next; 0: all share them.
inline int64_t PromptStride(const ConstNetworkSpan& places, int num_places) {
  const int64_t one = int64_t{num_places} * kPromptChannels;
  return places.size == one ? 0 : one / 8;
}
inline const uint4* Words(const ConstNetworkSpan& span) {
  return static_cast<const uint4*>(span.data);
}

}  // namespace pepeseg::prompt_places
