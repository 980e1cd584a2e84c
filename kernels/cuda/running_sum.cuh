#pragma once

#include <cstdint>

namespace pepeseg {

// Running sums over the blocks of one launch (Merrill and Garland 2016, decoupled look-back): a
// block learns the sum of the blocks before it without a second launch. Each block has a 64-bit
// word that holds its own sum, then its sum with all blocks before it; the top two bits say which.
// Flag and sum are in one word, which is written whole, so no fence is needed. Words must be 0
// before the launch. Sums are integers below 2^62, and therefore exact in any order.
inline constexpr uint64_t kHasOwnSum = uint64_t{1} << 62;
inline constexpr uint64_t kHasRunningSum = uint64_t{2} << 62;
inline constexpr uint64_t kSumMask = kHasOwnSum - 1;

// Sum over the lanes of a warp, in every lane.
__device__ inline uint64_t WarpSum(uint64_t value) {
  for (int offset = 16; offset > 0; offset /= 2) {
    value += __shfl_xor_sync(0xffffffffu, value, offset);
  }
  return value;
}

// Publishes a block's own sum and returns the sum of the blocks before it, in every lane. Called by
// one whole warp of each block. It spins until those blocks have published, so blocks must be
// numbered in the order in which they started (by an atomic ticket, not by blockIdx): all blocks
// before are then running or done, and the wait ends.
__device__ inline uint64_t SumOfBlocksBefore(volatile uint64_t* words, int block,
                                             uint64_t own_sum) {
  const int lane = static_cast<int>(threadIdx.x) & 31;
  if (lane == 0) words[block] = own_sum | (block == 0 ? +kHasRunningSum : +kHasOwnSum);
  if (block == 0) return 0;
  uint64_t before = 0;
  for (int end = block;; end -= 32) {
    // Lane k reads the block k + 1 before `end`; lanes ahead of the first block read a sum of 0.
    const int at = end - 1 - lane;
    uint64_t word = at < 0 ? +kHasRunningSum : words[at];
    while (__any_sync(0xffffffffu, word < kHasOwnSum)) {
      if (word < kHasOwnSum) word = words[at];
    }
    const uint32_t running = __ballot_sync(0xffffffffu, word >= kHasRunningSum);
    // The nearest running sum stands for all blocks before it: lanes beyond it do not count.
    const bool counts = running == 0 || lane <= __ffs(running) - 1;
    before += WarpSum(counts ? word & kSumMask : 0);
    if (running != 0) break;
  }
  if (lane == 0) words[block] = (before + own_sum) | kHasRunningSum;
  return before;
}

}  // namespace pepeseg
