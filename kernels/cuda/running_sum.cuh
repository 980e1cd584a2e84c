#pragma once

#include <cstdint>

namespace pepeseg {

// Sums over all blocks before, within one launch (Merrill and Garland 2016, decoupled look-back).
// A word holds a block's own sum, then its sum with everything before it; the top two bits say
// which. Words start as 0.
inline constexpr uint64_t kHasOwnSum = uint64_t{1} << 62;
inline constexpr uint64_t kHasRunningSum = uint64_t{2} << 62;
inline constexpr uint64_t kSumMask = kHasOwnSum - 1;

__device__ inline uint64_t WarpSum(uint64_t value) {
  for (int offset = 16; offset > 0; offset /= 2) {
    value += __shfl_xor_sync(0xffffffffu, value, offset);
  }
  return value;
}

// To be called by one whole warp of each block, with its own sum; the sum of the blocks before.
// Blocks must be numbered in the order in which they began, so that those before are running.
__device__ inline uint64_t SumOfBlocksBefore(volatile uint64_t* words, int block,
                                             uint64_t own_sum) {
  const int lane = static_cast<int>(threadIdx.x) & 31;
  if (lane == 0) words[block] = own_sum | (block == 0 ? +kHasRunningSum : +kHasOwnSum);
  if (block == 0) return 0;
  uint64_t before = 0;
  for (int end = block;; end -= 32) {
    // Lane 0 looks at the nearest block; those ahead of the first count as nothing.
    const int at = end - 1 - lane;
    uint64_t word = at < 0 ? +kHasRunningSum : words[at];
    while (__any_sync(0xffffffffu, word < kHasOwnSum)) {
      if (word < kHasOwnSum) word = words[at];
    }
    const uint32_t running = __ballot_sync(0xffffffffu, word >= kHasRunningSum);
    // Up to and with the nearest running sum.
    const bool counts = running == 0 || lane <= __ffs(running) - 1;
    before += WarpSum(counts ? word & kSumMask : 0);
    if (running != 0) break;
  }
  if (lane == 0) words[block] = (before + own_sum) | kHasRunningSum;
  return before;
}

}  // namespace pepeseg
