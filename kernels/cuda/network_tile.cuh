#pragma once

#include <cuda_fp16.h>

#include <cstdint>

#include "kernels/cuda/half_tiles.cuh"
#include "kernels/cuda/tensor_core.cuh"

// Tiles of two matrices in shared memory, their way there, and products of their 16 x 8 parts on
// the tensor cores: of halves (half_tiles.cuh), and of floats in two parts each (tensor_core.cuh).
// Both have sums as half_tiles.cuh says.

namespace pepeseg {

// Starts to copy 16 bytes to shared memory, or zeros where `inside` is false.
__device__ inline void CopyAsync(void* shared, const void* from, bool inside) {
  const auto to = static_cast<uint32_t>(__cvta_generic_to_shared(shared));
  asm volatile("cp.async.cg.shared.global [%0], [%1], 16, %2;" ::"r"(to), "l"(from),
               "r"(inside ? 16 : 0)
               : "memory");
}
__device__ inline void CommitCopies() { asm volatile("cp.async.commit_group;" ::: "memory"); }
// Waits until at most kPending of the groups of this thread are under way.
template <int kPending>
__device__ inline void WaitForCopies() {
  asm volatile("cp.async.wait_group %0;" ::"n"(kPending) : "memory");
}

// kCount values from memory aligned to their size, as floats, and back.
template <int kCount>
__device__ inline void LoadValues(const __half* from, float (&values)[kCount]) {
  struct alignas(kCount * 2) Halves {
    __half2 pairs[kCount / 2];
  };
  const Halves halves = *reinterpret_cast<const Halves*>(from);
#pragma unroll
  for (int k = 0; k < kCount / 2; ++k) {
    const float2 pair = __half22float2(halves.pairs[k]);
    values[2 * k] = pair.x;
    values[2 * k + 1] = pair.y;
  }
}
template <int kCount>
__device__ inline void LoadValues(const float* from, float (&values)[kCount]) {
#pragma unroll
  for (int k = 0; k < kCount; k += 4) {
    const float4 four = *reinterpret_cast<const float4*>(from + k);
    values[k] = four.x;
    values[k + 1] = four.y;
    values[k + 2] = four.z;
    values[k + 3] = four.w;
  }
}
template <int kCount>
__device__ inline void StoreValues(const float (&values)[kCount], __half* to) {
  struct alignas(kCount * 2) Halves {
    uint32_t pairs[kCount / 2];
  };
  Halves halves;
#pragma unroll
  for (int k = 0; k < kCount / 2; ++k) {
    halves.pairs[k] = PackHalves(values[2 * k], values[2 * k + 1]);
  }
  *reinterpret_cast<Halves*>(to) = halves;
}
template <int kCount>
__device__ inline void StoreValues(const float (&values)[kCount], float* to) {
#pragma unroll
  for (int k = 0; k < kCount; k += 4) {
    *reinterpret_cast<float4*>(to + k) = {values[k], values[k + 1], values[k + 2], values[k + 3]};
  }
}

// Shared memory of one step of a product: kRows x kStep values of the left matrix and kStep x
// kColumns of the right. Rows are padded so that the loads of a warp meet no bank twice.
inline constexpr int kStep = 32;
template <class T, int kRows, int kColumns>
struct ProductTile {
  static constexpr int kVector = 16 / sizeof(T);  // values of a copy
  static constexpr int kLeftPitch = kStep + (sizeof(T) == 2 ? 8 : 4);
  static constexpr int kRightPitch = kColumns + 8;

  T left[kRows * kLeftPitch];
  T right[kStep * kRightPitch];
};

// Adds the product of rows [row, row + kDown * 16) of the left tile with columns [column, column +
// kAcross * 8) of the right one.
template <int kRows, int kColumns, int kDown, int kAcross>
__device__ inline void MultiplyTiles(const ProductTile<__half, kRows, kColumns>& tile, int row,
                                     int column, float (&sums)[kDown][kAcross][4]) {
  using Tile = ProductTile<__half, kRows, kColumns>;
  const int lane = static_cast<int>(threadIdx.x) % 32;
#pragma unroll
  for (int k = 0; k < kStep; k += 16) {
    uint32_t a[kDown][4], b[kAcross / 2][4];
#pragma unroll
    for (int m = 0; m < kDown; ++m) {
      LoadMatrices(tile.left + (row + m * 16 + lane % 16) * Tile::kLeftPitch + k + lane / 16 * 8,
                   a[m]);
    }
#pragma unroll
    for (int n = 0; n < kAcross / 2; ++n) {
      LoadTransposed(
          tile.right + (k + lane % 16) * Tile::kRightPitch + column + n * 16 + lane / 16 * 8, b[n]);
    }
#pragma unroll
    for (int m = 0; m < kDown; ++m) {
#pragma unroll
      for (int n = 0; n < kAcross; ++n) {
        MultiplyHalves(a[m], b[n / 2][n % 2 * 2], b[n / 2][n % 2 * 2 + 1], sums[m][n]);
      }
    }
  }
}
template <int kRows, int kColumns, int kDown, int kAcross>
__device__ inline void MultiplyTiles(const ProductTile<float, kRows, kColumns>& tile, int row,
                                     int column, float (&sums)[kDown][kAcross][4]) {
  using Tile = ProductTile<float, kRows, kColumns>;
  const int i = static_cast<int>(threadIdx.x) % 32 / 4, j = static_cast<int>(threadIdx.x) % 4;
#pragma unroll
  for (int k = 0; k < kStep; k += 8) {
    SplitB b[kAcross];
#pragma unroll
    for (int n = 0; n < kAcross; ++n) {
      const float* at = tile.right + (k + j) * Tile::kRightPitch + column + n * 8 + i;
      const TwoParts first = Split(at[0]), second = Split(at[4 * Tile::kRightPitch]);
      b[n] = {{first.high, second.high}, {first.low, second.low}};
    }
#pragma unroll
    for (int m = 0; m < kDown; ++m) {
      const float* at = tile.left + (row + m * 16 + i) * Tile::kLeftPitch + k + j;
      const float values[4] = {at[0], at[8 * Tile::kLeftPitch], at[4],
                               at[8 * Tile::kLeftPitch + 4]};
      const SplitA a = SplitOf(values);
#pragma unroll
      for (int n = 0; n < kAcross; ++n) Multiply(a, b[n], sums[m][n]);
    }
  }
}

}  // namespace pepeseg
