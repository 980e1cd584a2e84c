#pragma once

#include <cstdint>

namespace pepeseg {

// A float as the sum of two numbers that the tensor cores take (tf32: 11 bits), to 2^-20 of it.
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

// The same of numbers in two parts, to about float's own precision: what both low parts give is
// left away.
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
// The mixed parts have a sum of their own, so that products need not wait for each other.
__device__ inline void Multiply(const SplitA& a, const SplitB& b, float (&sum)[4],
                                float (&mixed)[4]) {
  Multiply(a.high, b.high, sum);
  Multiply(a.low, b.high, mixed);
  Multiply(a.high, b.low, mixed);
}
__device__ inline void Multiply(const SplitA& a, const SplitB& b, float (&sum)[4]) {
  Multiply(a.low, b.high, sum);
  Multiply(a.high, b.low, sum);
  Multiply(a.high, b.high, sum);
}

}  // namespace pepeseg
