#include <algorithm>
#include <vector>

#include "kernels/cpu/cpu_backend.h"
#include "kernels/cpu/pair_plan.h"
#include "kernels/math/gate.h"

namespace pepeseg {
namespace {

// sums[k] = share * the sum over the blocks in their order, for k from first to last.
void AddSums(const std::vector<PairBlock>& blocks, PairLossSum first, PairLossSum last,
             double share, DeviceSpan<double> sums) {
  for (int k = first; k <= last; ++k) {
    sums[k] = 0;
    for (const PairBlock& block : blocks) sums[k] += share * block.sums[k];
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

// A task is a block of kPairRows pixels p, which it compares with all pixels q. Each ordered pair
// is thus evaluated once, twice the work of unordered ones, but each block writes only the
// gradients of its own pixels, in a fixed order. Gradients of positives and negatives are gathered
// apart, because their means need counts that are known only after all blocks.
void CpuBackend::PairLoss(const PairLossArgs& args) {
  if (failed()) return;
  PairPlan plan(args);
  PairJob& job = plan.job;
  std::vector<PairBlock> blocks(job.padded / kPairRows);
  const auto for_each_block = [&](auto&& body) {
    pool_.ParallelFor(static_cast<int64_t>(blocks.size()),
                      [&](int64_t i, int) { body(blocks[i]); });
  };
  for (size_t i = 0; i < blocks.size(); ++i) {
    blocks[i].first = static_cast<int>(i) * kPairRows;
    blocks[i].end = std::min(job.num_pixels, blocks[i].first + kPairRows);
  }
  for_each_block([&](PairBlock& block) { simd_.gate_pixels(job, block.first, block.end); });
  for_each_block([&](PairBlock& block) { simd_.pair_rows(job, block); });

  AddSums(blocks, kPositiveLoss, kNumNegatives, 0.5, args.sums);  // ordered pairs count twice
  args.sums[kNumNormPixels] = static_cast<double>(
      std::count_if(args.pixel_alpha.data, args.pixel_alpha.data + job.num_pixels,
                    [&](float alpha) { return alpha > args.min_norm_alpha; }));
  // The means' counts are known now; the last pass turns gathered sums into gradients.
  job.positive_scale = Inverse(args.sums[kNumPositives]);
  job.negative_scale = Inverse(args.sums[kNumNegatives]);
  job.norm_scale = Inverse(args.sums[kNumNormPixels]);
  for_each_block([&](PairBlock& block) { simd_.pair_rows_vjp(job, block); });
  AddSums(blocks, kNormLoss, kNormLoss, 1, args.sums);
  GateGradient(job, blocks);
}

}  // namespace pepeseg
