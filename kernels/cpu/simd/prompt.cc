#include "kernels/cpu/simd/kernels.h"
#include "kernels/cpu/simd/lanes.h"
#include "kernels/cpu/simd_kernels.h"

// Inner loops of SAM's decoder next to its products (kernels/ops/prompt_network.h).

namespace pepeseg {
namespace HWY_NAMESPACE {

// Two passes over a row that is in the cache: mean, then variance.
void NormalizeRows(const PromptNorm& norm, int size, float epsilon, float* rows, int count) {
  const Lanes inverse_size(1.0f / static_cast<float>(size));
  for (int row = 0; row < count; ++row, rows += size) {
    Lanes sum(0.0f), squares(0.0f);
    for (int i = 0; i < size; i += kLanes) sum = sum + Lanes::Load(rows + i);
    const Lanes mean = Total(sum) * inverse_size;
    for (int i = 0; i < size; i += kLanes) {
      const Lanes difference = Lanes::Load(rows + i) - mean;
      squares = MulAdd(difference, difference, squares);
    }
    const Lanes variance = Total(squares) * inverse_size;
    const Lanes inverse = Lanes(1.0f) / Sqrt(variance + Lanes(epsilon));
    for (int i = 0; i < size; i += kLanes) {
      const Lanes x = (Lanes::Load(rows + i) - mean) * inverse;
      MulAdd(x, Lanes::Load(norm.scale.data + i), Lanes::Load(norm.shift.data + i)).Store(rows + i);
    }
  }
}

void ExpRow(float* scores, int count, float& best, float& total) {
  Lanes most = Lanes::Load(scores);
  for (int i = kLanes; i < count; i += kLanes) most = Max(most, Lanes::Load(scores + i));
  const Lanes shift(hn::MaxOfLanes(FloatTag(), most.v));
  Lanes sum(0.0f);
  for (int i = 0; i < count; i += kLanes) {
    const Lanes weight = Exp(Lanes::Load(scores + i) - shift);
    sum = sum + weight;
    weight.Store(scores + i);
  }
  best = First(shift);
  total = First(Total(sum));
}

// Lanes are columns, so that a softmax runs over rows without shuffles.
void SoftmaxSlots(const SlotSoftmax& job) {
  for (int first = 0; first < job.num_rows; first += job.slots) {
    const float* bias = job.bias + first;
    for (int column = 0; column < kNetworkRows; column += kLanes) {
      float* scores = job.scores + first * kNetworkRows + column;
      Lanes most(-1e30f), total(0.0f);
      for (int k = 0; k < job.num_tokens; ++k) {
        const Lanes score = Lanes::Load(scores + k * kNetworkRows) + Lanes(bias[k]);
        most = Max(most, score);
        score.Store(scores + k * kNetworkRows);
      }
      for (int k = 0; k < job.num_tokens; ++k) {
        const Lanes weight = Exp(Lanes::Load(scores + k * kNetworkRows) - most);
        total = total + weight;
        weight.Store(scores + k * kNetworkRows);
      }
      const Lanes inverse = Lanes(1.0f) / total;
      for (int k = 0; k < job.slots; ++k) {
        float* const at = scores + k * kNetworkRows;
        (k < job.num_tokens ? Lanes::Load(at) * inverse : Lanes(0.0f)).Store(at);
      }
    }
  }
}

void MaskLogits(const float* cells, int count, const float* products, float* logits) {
  constexpr int kVectorsOfCell = kMaskChannels / kLanes;
  Lanes weights[kPromptMasks][kVectorsOfCell];
  for (int mask = 0; mask < kPromptMasks; ++mask) {
    for (int v = 0; v < kVectorsOfCell; ++v) {
      weights[mask][v] = Lanes::Load(products + mask * kMaskChannels + v * kLanes);
    }
  }
  for (int cell = 0; cell < count; ++cell, cells += kMaskChannels, logits += kPromptMasks) {
    Lanes sums[kPromptMasks];
    for (int mask = 0; mask < kPromptMasks; ++mask) {
      sums[mask] = Lanes::Load(cells) * weights[mask][0];
      for (int v = 1; v < kVectorsOfCell; ++v) {
        sums[mask] = MulAdd(Lanes::Load(cells + v * kLanes), weights[mask][v], sums[mask]);
      }
    }
    StoreSums(sums[0], sums[1], sums[2], sums[3], logits);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace pepeseg
