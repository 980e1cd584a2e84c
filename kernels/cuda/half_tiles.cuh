#pragma once

#include <cuda_fp16.h>

#include <cstdint>

// Products of small matrices of halves on the tensor cores, added in float. All 32 lanes of a warp
// must call these together. Sums within an instruction have an order fixed by the hardware: the
// same in every run on the same kind of device.

namespace pepeseg {

// sum += a b, 16 x 16 halves times 16 x 8, spread over a warp; a word has two halves, the first in
// its low bits. With i = lane / 4 and j = lane % 4 a lane holds
//   a: (i, 2j), (i + 8, 2j), (i, 2j + 8), (i + 8, 2j + 8), and the column right of each
//   b: (2j, i), (2j + 8, i), and the row below each
//   sum: (i, 2j), (i, 2j + 1), (i + 8, 2j), (i + 8, 2j + 1).
__device__ inline void MultiplyHalves(uint32_t a0, uint32_t a1, uint32_t a2, uint32_t a3,
                                      uint32_t b0, uint32_t b1, float (&sum)[4]) {
  asm("mma.sync.aligned.m16n8k16.row.col.f32.f16.f16.f32 "
      "{%0, %1, %2, %3}, {%4, %5, %6, %7}, {%8, %9}, {%0, %1, %2, %3};"
      : "+f"(sum[0]), "+f"(sum[1]), "+f"(sum[2]), "+f"(sum[3])
      : "r"(a0), "r"(a1), "r"(a2), "r"(a3), "r"(b0), "r"(b1));
}
__device__ inline void MultiplyHalves(const uint32_t (&a)[4], uint32_t b0, uint32_t b1,
                                      float (&sum)[4]) {
  MultiplyHalves(a[0], a[1], a[2], a[3], b0, b1, sum);
}

// Loads four matrices of 8 x 8 halves from shared memory. Lane k passes the address of row k % 8 of
// matrix k / 8, 16 bytes. A lane gets elements (i, 2j) and (i, 2j + 1) of each.
__device__ inline void LoadMatrices(const __half* row, uint32_t (&out)[4]) {
  const auto at = static_cast<uint32_t>(__cvta_generic_to_shared(row));
  asm volatile("ldmatrix.sync.aligned.m8n8.x4.shared.b16 {%0, %1, %2, %3}, [%4];"
               : "=r"(out[0]), "=r"(out[1]), "=r"(out[2]), "=r"(out[3])
               : "r"(at)
               : "memory");
}
// As LoadMatrices, but a lane gets elements (2j, i) and (2j + 1, i).
__device__ inline void LoadTransposed(const __half* row, uint32_t (&out)[4]) {
  const auto at = static_cast<uint32_t>(__cvta_generic_to_shared(row));
  asm volatile("ldmatrix.sync.aligned.m8n8.x4.trans.shared.b16 {%0, %1, %2, %3}, [%4];"
               : "=r"(out[0]), "=r"(out[1]), "=r"(out[2]), "=r"(out[3])
               : "r"(at)
               : "memory");
}

__device__ inline uint32_t PackHalves(float low, float high) {
  const __half2 two = __floats2half2_rn(low, high);
  return reinterpret_cast<const uint32_t&>(two);
}
__device__ inline float2 UnpackHalves(uint32_t word) {
  return __half22float2(reinterpret_cast<const __half2&>(word));
}
__device__ inline uint32_t AddHalves(uint32_t a, uint32_t b) {
  const __half2 sum =
      __hadd2(reinterpret_cast<const __half2&>(a), reinterpret_cast<const __half2&>(b));
  return reinterpret_cast<const uint32_t&>(sum);
}
__device__ inline uint4 AddHalves(const uint4& a, const uint4& b) {
  return {AddHalves(a.x, b.x), AddHalves(a.y, b.y), AddHalves(a.z, b.z), AddHalves(a.w, b.w)};
}

// sum += a b for 32 of the columns of a that both share, where the order of these columns does not
// matter: lane j of a row takes columns 8j to 8j + 7 instead of four pairs, so that it loads 16
// bytes at once. low, high: of rows i and i + 8 of a; b: of row i of the transposed b.
__device__ inline void MultiplyChunk(const uint4& low, const uint4& high, const uint4& b,
                                     float (&sum)[4]) {
  MultiplyHalves(low.x, high.x, low.y, high.y, b.x, b.y, sum);
  MultiplyHalves(low.z, high.z, low.w, high.w, b.z, b.w, sum);
}

// Stride of rows in shared memory for lanes that load as MultiplyChunk says, so that they use all
// banks: 64 bytes more than a multiple of 128.
constexpr int ChunkStride(int columns) { return columns + 32; }
// Stride of rows in shared memory for LoadMatrices: 16 bytes more than a multiple of 128.
constexpr int MatrixStride(int columns) { return columns + 8; }

// Sums over the four lanes that share a row of `sum` above; all get the result.
__device__ inline float RowSum(float x) {
  x += __shfl_xor_sync(~0u, x, 1);
  return x + __shfl_xor_sync(~0u, x, 2);
}
__device__ inline float RowMax(float x) {
  x = fmaxf(x, __shfl_xor_sync(~0u, x, 1));
  return fmaxf(x, __shfl_xor_sync(~0u, x, 2));
}

// Copies rows of `columns` halves, a multiple of 8, from global to shared memory. Called by all
// threads of a block, which must meet at __syncthreads before they read.
template <int kColumns, int kStride>
__device__ void CopyRows(const uint4* from, int num_rows, __half* to) {
  constexpr int kChunks = kColumns / 8;
  for (int i = static_cast<int>(threadIdx.x); i < num_rows * kChunks;
       i += static_cast<int>(blockDim.x)) {
    *reinterpret_cast<uint4*>(to + i / kChunks * kStride + i % kChunks * 8) = from[i];
  }
}

}  // namespace pepeseg
