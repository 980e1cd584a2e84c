#pragma once

#include <cstdint>

#include "kernels/math/feature.h"
#include "kernels/math/gate.h"
#include "kernels/ops/feature.h"

// What the kernels of stage two share: features of 32 channels in a warp, a channel a lane; the sum
// over the entries of a sparse row; and the scale gate (formulas in kernels/math/gate.h).

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

// Returns the group of an element: first[group] <= i < first[group + 1]. `first` is ascending, with
// one element more than there are groups, and first[0] <= i. Binary search.
__device__ inline int GroupOf(const DeviceSpan<const int32_t>& first, int64_t i) {
  int low = 0, high = static_cast<int>(first.size) - 1;
  while (low + 1 < high) {
    const int middle = (low + high) / 2;
    (first.data[middle] <= i ? low : high) = middle;
  }
  return low;
}

// The entries of column i.
__device__ inline EntryRange ColumnOf(const ColumnSpan& columns, int64_t i) {
  return {columns.first.data[i], columns.first.data[i + 1], columns.pixel.data,
          columns.weight.size == 0 ? nullptr : columns.weight.data};
}

static_assert(kGateHidden == kFeatureSize, "one lane per channel and hidden unit");
static_assert(kTwoLayerGateSize == TwoLayerGateSize(kFeatureSize));

// Channel `channel` of psi at a scale.
__device__ inline float PsiChannel(DeviceSpan<const float> gate, float scale, int channel) {
  return GateChannel(GateNumbers<float>{gate.data, gate.size}, kFeatureSize, channel, scale);
}

// Adds the gradients of a gate of two layers at one scale, from bias_grad, a lane's channel of the
// gradient of b2. Called by a whole warp, which alone writes gate_grad. Lane j keeps the gradient
// of hidden unit j, which a butterfly of shuffles sums over the channels; each lane then adds to
// numbers of its own, so that nothing needs a barrier.
__device__ inline void AddTwoLayerGrad(const float* gate, float scale, float bias_grad,
                                       float* gate_grad) {
  const int lane = static_cast<int>(threadIdx.x) % 32;
  float hidden_grad = 0;
  for (int j = 0; j < kGateHidden; ++j) {
    const int at = 2 * kGateHidden + j * kFeatureSize + lane;
    const float sum = Total(Channel(gate[at] * bias_grad)).v;
    if (lane == j) hidden_grad = sum;
    gate_grad[at] = MulAdd(HiddenUnit(gate, j, scale), bias_grad, gate_grad[at]);
  }
  gate_grad[2 * kGateHidden + kGateHidden * kFeatureSize + lane] += bias_grad;
  if (!(HiddenUnit(gate, lane, scale) > 0)) return;
  gate_grad[lane] = MulAdd(scale, hidden_grad, gate_grad[lane]);
  gate_grad[kGateHidden + lane] += hidden_grad;
}

}  // namespace pepeseg
