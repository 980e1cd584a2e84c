#pragma once

#include <cstdint>

#include "kernels/math/pair.h"
#include "kernels/ops/feature.h"

// Features of 32 channels in a warp, a channel a lane, and the sum over sparse entries that the
// kernels of stage two share.

namespace pepeseg {

// One channel of a feature vector that a warp holds. To the formulas of kernels/math it is a vector
// of one element whose Total is the sum over the 32 lanes, so all lanes must call them together.
struct Channel {
  float v;
  PEPESEG_HD explicit Channel(float x) : v(x) {}
};
static_assert(kFeatureSize == 32);

PEPESEG_HD Channel operator+(Channel a, Channel b) { return Channel(a.v + b.v); }
PEPESEG_HD Channel operator-(Channel a, Channel b) { return Channel(a.v - b.v); }
PEPESEG_HD Channel operator*(Channel a, Channel b) { return Channel(a.v * b.v); }
PEPESEG_HD Channel operator/(Channel a, Channel b) { return Channel(a.v / b.v); }
PEPESEG_HD Channel MulAdd(Channel a, Channel b, Channel c) {
  return Channel(MulAdd(a.v, b.v, c.v));
}
PEPESEG_HD Channel Sqrt(Channel x) { return Channel(Sqrt(x.v)); }
// Sum over the lanes, in each lane: a butterfly of shuffles, always in the same order.
PEPESEG_HD Channel Total(Channel x) {
#ifdef __CUDA_ARCH__
  for (int offset = 16; offset > 0; offset /= 2) x.v += __shfl_xor_sync(~0u, x.v, offset);
#endif
  return x;
}

// Entries [first, end) of a sparse row or column: which feature vectors it sums, and their weights.
struct EntryRange {
  int32_t first, end;
  const int32_t* index;
  const float* weight;  // null: all are 1
};

// Returns channel `lane` of the sum over the entries of weight * rows[index], in their order.
// Called by a whole warp with the same entries. Lanes read 32 entries together and pass them on by
// shuffles; kAtOnce loads of features are in flight at once.
template <int kAtOnce>
__device__ float WeightedSum(const EntryRange& entries, const float* rows, int lane) {
  float sum = 0;
  for (int32_t base = entries.first; base < entries.end; base += 32) {
    const int count = min(32, entries.end - base);
    const int32_t index = lane < count ? entries.index[base + lane] : 0;
    float weight = lane < count ? 1.0f : 0.0f;
    if (lane < count && entries.weight != nullptr) weight = entries.weight[base + lane];
    for (int k = 0; k < count; k += kAtOnce) {
      float value[kAtOnce];
#pragma unroll
      for (int j = 0; j < kAtOnce; ++j) {
        const int64_t row = __shfl_sync(~0u, index, k + j);
        value[j] = k + j < count ? rows[row * kFeatureSize + lane] : 0.0f;
      }
#pragma unroll
      for (int j = 0; j < kAtOnce; ++j) {
        sum = MulAdd(__shfl_sync(~0u, weight, k + j), value[j], sum);
      }
    }
  }
  return sum;
}

// The entries of column i.
__device__ inline EntryRange ColumnOf(const ColumnSpan& columns, int64_t i) {
  return {columns.first.data[i], columns.first.data[i + 1], columns.pixel.data,
          columns.weight.size == 0 ? nullptr : columns.weight.data};
}

}  // namespace pepeseg
