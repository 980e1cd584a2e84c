#pragma once

#include <cstdint>

// Products of small matrices on the tensor cores: of bytes, exactly, and of floats, to about the
// precision of float. For floats the tensor cores take tf32, floats with 11 significant bits, so
// each factor is split into a high and a low part and three products are added: high * high, low *
// high and high * low. All 32 lanes of a warp must call them together. Sums within an instruction
// have an order fixed by the hardware: the same in every run on the same kind of device.

namespace pepeseg {

// A float as the sum of two tf32 numbers, to 2^-20 of its value. Parts are bits of floats, whose
// lower 13 bits are 0.
struct TwoParts {
  uint32_t high, low;
};
__device__ inline TwoParts Split(float x) {
  constexpr uint32_t kTaken = 0xffffe000u;
  const uint32_t high = __float_as_uint(x) & kTaken;
  return {high, __float_as_uint(x - __uint_as_float(high)) & kTaken};
}

// sum += a b, 16 x 8 numbers times 8 x 8, spread over a warp. With i = lane / 4 and j = lane % 4 a
// lane has
//   a: (i, j), (i + 8, j), (i, j + 4), (i + 8, j + 4)
//   b: (j, i), (j + 4, i)
//   sum: (i, 2 j), (i, 2 j + 1), (i + 8, 2 j), (i + 8, 2 j + 1).
__device__ inline void Multiply(const uint32_t (&a)[4], const uint32_t (&b)[2], float (&sum)[4]) {
  asm("mma.sync.aligned.m16n8k8.row.col.f32.tf32.tf32.f32 "
      "{%0, %1, %2, %3}, {%4, %5, %6, %7}, {%8, %9}, {%0, %1, %2, %3};"
      : "+f"(sum[0]), "+f"(sum[1]), "+f"(sum[2]), "+f"(sum[3])
      : "r"(a[0]), "r"(a[1]), "r"(a[2]), "r"(a[3]), "r"(b[0]), "r"(b[1]));
}

// sum += a b, 16 x 32 bytes times 32 x 8, exactly, spread over a warp. A register holds four
// adjacent bytes. With i = lane / 4 and j = lane % 4 a lane holds
//   a: (i, 4 j ..), (i + 8, 4 j ..), (i, 16 + 4 j ..), (i + 8, 16 + 4 j ..)
//   b: (4 j .., i), (16 + 4 j .., i)
//   sum: (i, 2 j), (i, 2 j + 1), (i + 8, 2 j), (i + 8, 2 j + 1).
__device__ inline void MultiplyBytes(const uint32_t (&a)[4], const uint32_t (&b)[2],
                                     int32_t (&sum)[4]) {
  asm("mma.sync.aligned.m16n8k32.row.col.s32.u8.u8.s32 "
      "{%0, %1, %2, %3}, {%4, %5, %6, %7}, {%8, %9}, {%0, %1, %2, %3};"
      : "+r"(sum[0]), "+r"(sum[1]), "+r"(sum[2]), "+r"(sum[3])
      : "r"(a[0]), "r"(a[1]), "r"(a[2]), "r"(a[3]), "r"(b[0]), "r"(b[1]));
}

// Factors in two parts, laid out as in Multiply above. The product of the low parts, about 2^-20 of
// the whole, is left out.
struct SplitA {
  uint32_t high[4], low[4];
};
struct SplitB {
  uint32_t high[2], low[2];
};
__device__ inline SplitA SplitOf(const float (&a)[4]) {
  SplitA out;
#pragma unroll
  for (int e = 0; e < 4; ++e) {
    const TwoParts parts = Split(a[e]);
    out.high[e] = parts.high;
    out.low[e] = parts.low;
  }
  return out;
}
// The mixed products have a sum of their own, so that the instructions need not wait for each
// other. The caller adds the two.
__device__ inline void Multiply(const SplitA& a, const SplitB& b, float (&sum)[4],
                                float (&mixed)[4]) {
  Multiply(a.high, b.high, sum);
  Multiply(a.low, b.high, mixed);
  Multiply(a.high, b.low, mixed);
}
// The same with one sum, where registers are short. The small products are added first.
__device__ inline void Multiply(const SplitA& a, const SplitB& b, float (&sum)[4]) {
  Multiply(a.low, b.high, sum);
  Multiply(a.high, b.low, sum);
  Multiply(a.high, b.high, sum);
}

}  // namespace pepeseg
