#include <algorithm>
#include <cassert>
#include <cmath>
#include <vector>

#include "kernels/cpu/cpu_backend.h"
#include "kernels/cpu/simd_kernels.h"
#include "kernels/math/gate.h"

namespace pepeseg {
namespace {

// Everything of PairLoss that does not depend on features, and the working memory of its passes.
// `job` points into the plan and into `args`, which must outlive it.
struct PairPlan {
  PairPlan(const PairLossArgs& args, PairMemory& memory);

  // Calls body(panel) for the panels on and above the diagonal, row by row. The bits of a panel are
  // valid during the call.
  template <class Body>
  void ForEachPanel(Body&& body) {
    for (int row = 0; row < job.padded; row += kPairPanel) {
      for (int column = row; column < job.padded; column += kPairPanel) {
        body(PairPanel{row, std::min(row + kPairPanel, job.padded), column,
                       std::min(column + kPairPanel, job.padded), bits_,
                       row == column ? bits_ : bits_ + num_bits_});
      }
    }
  }

  PairJob job;

 private:
  void GateScales(const PairLossArgs& args);
  void ComparePatches(const PairLossArgs& args);
  void LimitDraws(const PairLossArgs& args);
  void ScaleWeights(const PairLossArgs& args);

  std::vector<float> psi_, pixel_weight_;
  std::vector<int32_t> cell_;
  std::vector<uint32_t> agrees_;
  int64_t num_bits_ = 0;      // words of the bits of a panel
  uint16_t* bits_ = nullptr;  // of a panel and, if there are several, of its mirrored one
};

// Share of all pairs that counts as hard at least, for the number of easy ones.
constexpr double kMinHardShare = 0.05;

static_assert(kGateSize == OneLayerGateSize(kFeatureSize) &&
              kTwoLayerGateSize == TwoLayerGateSize(kFeatureSize));

PairPlan::PairPlan(const PairLossArgs& args, PairMemory& memory) : job() {
  const auto num_pixels = static_cast<int>(args.pixel_weight.size);
  const auto num_scales = static_cast<int>(args.scales.size);
  assert(num_scales >= 1 && num_scales <= kMaxScales && num_pixels < 1 << 16);
  job.args = &args;
  job.num_pixels = num_pixels;
  job.num_scales = num_scales;
  job.padded = (num_pixels + kPairRows - 1) / kPairRows * kPairRows;
  const size_t num_units = size_t{1} * num_scales * job.padded * kFeatureSize;
  // The passes write the values of a pixel before they read them. Results do not depend on those
  // of the padding.
  job.unit = Reserve(memory.unit, num_units);
  job.unit_by_channel = Reserve(memory.unit_by_channel, num_units);
  job.unit_grad = Reserve(memory.unit_grad, 2 * num_units);
  const int64_t side = std::min(job.padded, kPairPanel);
  num_bits_ = side * (side / kPairTile) * 2 * num_scales;
  bits_ = Reserve(memory.bits, num_bits_ * (job.padded > side ? 2 : 1));
  GateScales(args);
  ComparePatches(args);
  LimitDraws(args);
  ScaleWeights(args);
  job.psi = psi_.data();
  job.cell = cell_.data();
  job.agrees = agrees_.data();
  job.pixel_weight = pixel_weight_.data();
}

// psi of each scale.
void PairPlan::GateScales(const PairLossArgs& args) {
  psi_.resize(args.scales.size * kFeatureSize);
  for (int64_t scale = 0; scale < args.scales.size; ++scale) {
    GateAt({args.gate.data, args.gate.size}, kFeatureSize, args.scales[scale],
           psi_.data() + scale * kFeatureSize);
  }
}

// Compares the labels of all pairs of mask cells at all scales, so that the loop over pixel pairs
// needs only a table look-up. Padding pixels are in cell 0; they are masked out later.
void PairPlan::ComparePatches(const PairLossArgs& args) {
  cell_.assign(job.padded, 0);
  std::copy_n(args.pixel_cell.data, job.num_pixels, cell_.begin());
  const int64_t num_cells = args.num_cells, words = args.label_words;
  agrees_.assign(num_cells * num_cells, 0);
  for (int scale = 0; scale < job.num_scales; ++scale) {
    const uint64_t* labels = args.labels.data + scale * num_cells * words;
    for (int64_t a = 0; a < num_cells; ++a) {
      for (int64_t b = 0; b < num_cells; ++b) {
        uint64_t common = 0;
        for (int64_t w = 0; w < words; ++w) common |= labels[a * words + w] & labels[b * words + w];
        agrees_[a * num_cells + b] |= static_cast<uint32_t>(common != 0) << scale;
      }
    }
  }
}

// Chooses the limits of the hash so that the draw yields the wanted number of easy pairs on
// average. Pairs are counted by mask cell.
void PairPlan::LimitDraws(const PairLossArgs& args) {
  std::vector<double> num_pixels(args.num_cells);
  for (int p = 0; p < job.num_pixels; ++p) ++num_pixels[args.pixel_cell[p]];
  const uint32_t all = (1u << job.num_scales) - 1u;  // agreement at every scale
  double hard = 0, positive = 0, negative = 0;
  for (int a = 0; a < args.num_cells; ++a) {
    for (int b = 0; b <= a; ++b) {
      const double pairs =
          a == b ? num_pixels[a] * (num_pixels[a] - 1) / 2 : num_pixels[a] * num_pixels[b];
      const uint32_t agrees = agrees_[int64_t{a} * args.num_cells + b];
      (agrees == all ? positive : agrees == 0 ? negative : hard) += pairs;
    }
  }
  // Masks that do not nest make no hard pairs, but objects must be held together all the same.
  hard = std::max(hard, kMinHardShare * (hard + positive + negative));
  // The share of the available pairs to draw, as a limit of 31-bit hashes.
  const auto limit = [&](double available) {
    const double share = available == 0 ? 0 : std::min(1.0, args.easy_share * hard / available);
    return static_cast<int32_t>(share * 2147483647.0);
  };
  // Two kinds, each of which has easy_share: together they are drawn from half of the pairs each.
  const double half = (positive + negative) / 2;
  job.positive_limit = limit(args.joint_mean ? half : positive);
  job.negative_limit = limit(args.joint_mean ? half : negative);
}

// Finds base and slope that map the products of pixel weights to [1, 10]. The extreme products are
// those of the two smallest and of the two largest weights.
void PairPlan::ScaleWeights(const PairLossArgs& args) {
  pixel_weight_.assign(job.padded, 0.0f);
  std::copy_n(args.pixel_weight.data, job.num_pixels, pixel_weight_.begin());
  job.weight_base = 1;
  if (job.num_pixels < 2) return;
  std::vector<float> sorted(pixel_weight_.begin(), pixel_weight_.begin() + job.num_pixels);
  std::sort(sorted.begin(), sorted.end());
  const double low = double{sorted[0]} * sorted[1];
  const double high = double{sorted[sorted.size() - 1]} * sorted[sorted.size() - 2];
  constexpr double kRange = 9;  // from 1 to 10
  if (high - low <= 1e-6 * high) return;
  job.weight_slope = static_cast<float>(kRange / (high - low));
  job.weight_base = static_cast<float>(1 - kRange * low / (high - low));
}

// sums[k] = the sum over the blocks in their order, for k from first to last.
void AddSums(const std::vector<PairBlock>& blocks, PairLossSum first, PairLossSum last,
             DeviceSpan<double> sums) {
  for (int k = first; k <= last; ++k) {
    sums[k] = 0;
    for (const PairBlock& block : blocks) sums[k] += block.sums[k];
  }
}

// 1 / count, or 0 for none.
float Inverse(double count) { return count == 0 ? 0.0f : static_cast<float>(1 / count); }

// Adds the blocks' gradients of psi in their order and passes them on to the gate.
void GateGradient(const PairJob& job, const std::vector<PairBlock>& blocks) {
  const PairLossArgs& args = *job.args;
  std::fill_n(args.gate_grad.data, args.gate_grad.size, 0.0f);
  for (int scale = 0; scale < job.num_scales; ++scale) {
    float psi_grad[kFeatureSize] = {};
    for (const PairBlock& block : blocks) {
      for (int k = 0; k < kFeatureSize; ++k) {
        psi_grad[k] += block.psi_grad[scale * kFeatureSize + k];
      }
    }
    GateAtVjp({args.gate.data, args.gate.size}, kFeatureSize, args.scales[scale], psi_grad,
              args.gate_grad.data);
  }
}

}  // namespace

// A task is a block of kPairRows pixels p. Pairs are chosen once for both pixels, panel by panel;
// then each pixel gathers its own gradient in a fixed order: over the panels in theirs, and within
// a panel over the other pixels in ascending order. Gradients of positives and negatives are
// gathered apart, because their means need counts that are known only after all blocks.
void CpuBackend::PairLoss(const PairLossArgs& args) {
  if (failed()) return;
  const auto memory = pair_memory_.Take();
  PairPlan plan(args, *memory);
  PairJob& job = plan.job;
  std::vector<PairBlock> blocks(job.padded / kPairRows);
  const auto for_blocks = [&](int first, int end, auto&& body) {
    const int from = first / kPairRows;
    pool_.ParallelFor(end / kPairRows - from, [&](int64_t i, int) { body(blocks[from + i]); });
  };
  for (size_t i = 0; i < blocks.size(); ++i) {
    blocks[i].first = static_cast<int>(i) * kPairRows;
    blocks[i].end = std::min(job.num_pixels, blocks[i].first + kPairRows);
  }
  for_blocks(0, job.padded,
             [&](PairBlock& block) { simd_.gate_pixels(job, block.first, block.end); });
  plan.ForEachPanel([&](const PairPanel& panel) {
    for_blocks(panel.first_row, panel.end_row,
               [&](PairBlock& block) { simd_.choose_pairs(job, panel, block); });
    for_blocks(panel.first_row, panel.end_row,
               [&](PairBlock& block) { simd_.gather_pairs(job, panel, block.first, block.end); });
    if (panel.diagonal()) return;
    const PairPanel swapped = panel.Swapped();
    for_blocks(swapped.first_row, swapped.end_row,
               [&](PairBlock& block) { simd_.gather_pairs(job, swapped, block.first, block.end); });
  });

  AddSums(blocks, kPositiveLoss, kNumNegatives, args.sums);
  args.sums[kNumNormPixels] = static_cast<double>(
      std::count_if(args.pixel_alpha.data, args.pixel_alpha.data + job.num_pixels,
                    [&](float alpha) { return alpha > args.min_norm_alpha; }));
  // The means' counts are known now; the last pass turns gathered sums into gradients.
  const double positives = args.sums[kNumPositives], negatives = args.sums[kNumNegatives];
  job.positive_scale = Inverse(positives + (args.joint_mean ? negatives : 0));
  job.negative_scale = Inverse(negatives + (args.joint_mean ? positives : 0));
  job.norm_scale = Inverse(args.sums[kNumNormPixels]);
  for_blocks(0, job.padded, [&](PairBlock& block) { simd_.pair_rows_vjp(job, block); });
  AddSums(blocks, kNormLoss, kNormLoss, args.sums);
  GateGradient(job, blocks);
}

}  // namespace pepeseg
