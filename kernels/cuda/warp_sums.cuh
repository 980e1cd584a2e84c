#pragma once

namespace pepeseg {

// Sums each of N values over the 32 lanes of a warp. At each of five levels a lane gives half of
// its values to its partner and takes over the other half, so that 10 values take 12 shuffles and
// not 50. Afterwards value[0] of a lane is sum number IndexOfSum<N>(lane), and the other values are
// unspecified. All 32 lanes must call it. The order of each sum is a fixed tree, so results are the
// same in every run.
template <int N, int kOffset = 16>
__device__ inline void SumOverWarp(float (&value)[N], int lane) {
  constexpr int kHalf = (N + 1) / 2;
  float half[kHalf];
  const bool upper = (lane & kOffset) != 0;
#pragma unroll
  for (int i = 0; i < kHalf; ++i) {
    if (i + kHalf < N) {
      const float give = upper ? value[i] : value[i + kHalf];
      const float keep = upper ? value[i + kHalf] : value[i];
      half[i] = keep + __shfl_xor_sync(0xffffffffu, give, kOffset);
    } else {
      half[i] = value[i] + __shfl_xor_sync(0xffffffffu, value[i], kOffset);
    }
  }
  if constexpr (kOffset > 1) SumOverWarp<kHalf, kOffset / 2>(half, lane);
  value[0] = half[0];
}

// The sum, in [0, N), that a lane holds after SumOverWarp. Several lanes may hold the same sum; its
// bits are then equal, as float addition is commutative.
template <int N, int kOffset = 16>
__device__ inline int IndexOfSum(int lane) {
  constexpr int kHalf = (N + 1) / 2;
  int index = 0;
  if constexpr (kOffset > 1) index = IndexOfSum<kHalf, kOffset / 2>(lane);
  return (lane & kOffset) != 0 && index + kHalf < N ? index + kHalf : index;
}

}  // namespace pepeseg
