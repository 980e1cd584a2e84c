#include <algorithm>
#include <vector>

#include "kernels/cpu/cpu_backend.h"
#include "kernels/math/gate.h"

namespace pepeseg {
namespace {

constexpr int64_t kBlock = 32;  // pixels of a task, and the granularity of the sums

// Adds the blocks in their order, whichever thread had them. Each pair is listed twice, hence 0.5.
void SumBlocks(const PerceptionJob& job, const std::vector<PerceptionBlock>& blocks) {
  const PerceptionLossArgs& args = *job.args;
  args.loss[0] = 0;
  for (const PerceptionBlock& block : blocks) args.loss[0] += 0.5 * block.loss;
  for (int scale = 0; scale < job.num_scales; ++scale) {
    const int at = scale * kFeatureSize;
    float psi_grad[kFeatureSize] = {};
    for (const PerceptionBlock& block : blocks) {
      for (int k = 0; k < kFeatureSize; ++k) psi_grad[k] += block.psi_grad[at + k];
    }
    GateAtVjp({args.gate.data, args.gate.size}, kFeatureSize, args.scales[scale], psi_grad,
              args.gate_grad.data);
  }
}

}  // namespace

// Two passes over the pixels: the gated unit vectors of all pixels with a pair, then the pairs. A
// task writes only the gradients of its own pixels.
void CpuBackend::PerceptionLoss(const PerceptionLossArgs& args) {
  if (failed()) return;
  const int64_t num_pixels = args.first.size - 1;
  const auto num_scales = static_cast<int>(args.scales.size);
  std::vector<float> psi(num_scales * kFeatureSize);
  for (int scale = 0; scale < num_scales; ++scale) {
    GateAt({args.gate.data, args.gate.size}, kFeatureSize, args.scales[scale],
           psi.data() + scale * kFeatureSize);
  }
  const auto unit = values_.Take();
  const PerceptionJob job = {&args, num_scales, psi.data(),
                             Reserve(*unit, num_pixels * num_scales * kFeatureSize)};
  std::vector<PerceptionBlock> blocks((num_pixels + kBlock - 1) / kBlock);
  for (size_t i = 0; i < blocks.size(); ++i) {
    blocks[i].first = static_cast<int64_t>(i) * kBlock;
    blocks[i].end = std::min(num_pixels, blocks[i].first + kBlock);
  }
  const auto for_each_block = [&](auto&& body) {
    pool_.ParallelFor(static_cast<int64_t>(blocks.size()),
                      [&](int64_t i, int) { body(blocks[i]); });
  };
  for_each_block([&](const PerceptionBlock& block) {
    simd_.perception_units(job, {block.first, block.end});
  });
  for_each_block([&](PerceptionBlock& block) { simd_.perception_rows(job, block); });
  SumBlocks(job, blocks);
}

}  // namespace pepeseg
