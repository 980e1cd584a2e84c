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

void QuantizeMask(const MaskRow& row) {
  const FloatTag d;
  const hn::Rebind<int8_t, FloatTag> bytes;
  for (int word = 0; word < row.count / 32; ++word) {
    // Bits of the cells over each threshold, without those that are not shown.
    uint32_t over[3] = {};
    for (int bit = 0; bit < 32; bit += kLanes) {
      const int x = 32 * word + bit;
      const Lanes logits = Lanes::Load(row.logits + x);
      const Lanes quarters = Max(Lanes(-127.0f), Min(Lanes(127.0f), logits * Lanes(4.0f)));
      // Halves are rounded away from 0.
      const auto half = hn::CopySign(hn::Set(d, 0.5f), quarters.v);
      hn::StoreU(hn::DemoteTo(bytes, hn::ConvertTo(IntTag(), hn::Add(quarters.v, half))), bytes,
                 row.quarters + x);
      const int shown = Max(0, Min(kLanes, row.shown - x));
      const uint32_t counted = (uint32_t{1} << shown) - 1;
      for (int at = 0; at < 3; ++at) {
        const Lanes threshold(static_cast<float>(at - 1));
        over[at] |= (BitsOf(threshold < logits) & counted) << bit;
      }
    }
    row.bits[word] = over[1];
    for (int at = 0; at < 3; ++at) row.over[at] += __builtin_popcount(over[at]);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace pepeseg
