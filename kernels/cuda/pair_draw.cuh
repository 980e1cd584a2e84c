#pragma once

#include <cstdint>

#include "kernels/cuda/pair_work.cuh"

namespace pepeseg {

// The draw of easy pairs (see PairLossArgs), the same as on the CPU (kernels/cpu/pair_plan.h): a
// constant-positive, or constant-negative, pair is drawn if its 31-bit hash is below the limit.
struct DrawLimits {
  int32_t positive, negative;
};

// Limits that draw, on average, easy_share pairs of each kind for each hard pair, or as for
// kMinHardShare of all pairs if fewer are hard. Reads the counts of pair_plan.cu.
__device__ inline DrawLimits LimitDraws(const PairWork& work) {
  constexpr double kMinHardShare = 0.05;  // of all pairs, for the number of easy ones
  const auto positive = static_cast<double>(work.counts->constant_positive / 2);
  const auto negative = static_cast<double>(work.counts->constant_negative / 2);
  const auto counted = static_cast<double>(work.counts->hard / 2);
  const double hard = max(counted, kMinHardShare * (counted + positive + negative));
  const auto limit = [&](double available) {
    const double wanted = static_cast<double>(work.args.easy_share) * hard;
    const double share = available == 0 ? 0 : min(1.0, wanted / available);
    return static_cast<int32_t>(share * 2147483647.0);
  };
  return {limit(positive), limit(negative)};
}

// Returns 31 random bits for a pair, the same for (p, q) and (q, p). p and q are below 2^16.
__device__ inline int32_t PairHash(uint32_t p, uint32_t q, uint32_t seed) {
  uint32_t h = (max(p, q) << 16 | min(p, q)) ^ seed;
  h = (h ^ h >> 16) * 0x7feb352du;
  h = (h ^ h >> 15) * 0x846ca68bu;
  return static_cast<int32_t>((h ^ h >> 16) >> 1);
}

}  // namespace pepeseg
