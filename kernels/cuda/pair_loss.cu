#include <cuda_runtime.h>

#include "kernels/cuda/cuda_backend.h"
#include "kernels/cuda/pair_work.cuh"

// PairLoss (PairLossArgs in kernels/ops/feature.h; METHOD.md section 3, "Contrastive loss" and
// "Norms"): the host side, which sizes the working memory and launches the passes in their order.
// The host waits for nothing, so the op can be recorded. Contracts that the passes share are in
// pair_work.cuh.

namespace pepeseg {

PairWork TakePairWork(const PairLossArgs& args, Arena& arena) {
  PairWork work = {};
  work.args = args;
  work.num_pixels = static_cast<int>(args.pixel_weight.size);
  work.num_scales = static_cast<int>(args.scales.size);
  work.padded = (work.num_pixels + kPairPad - 1) / kPairPad * kPairPad;
  const int64_t padded = work.padded, scales = work.num_scales, patches = args.num_patches;
  work.counts = arena.Take<PairCounts>(1);
  work.weights = arena.Take<PairWeights>(1);
  work.psi = arena.Take<float>(scales * kFeatureSize);
  work.inv_norm = arena.Take<float>(scales * padded);
  work.plan = arena.Take<PairBits>(padded * padded);
  work.tile_part = arena.Take<PairLossPart>(NumPairTiles(work));
  work.unit_grad = arena.Take<float>(kPairSplits * scales * padded * kFeatureSize);
  work.psi_grad = arena.Take<float>(NumPixelBlocks(work) * scales * kFeatureSize);
  work.norm_loss = arena.Take<double>(NumPixelBlocks(work));
  work.agrees = arena.Take<uint32_t>(patches * patches);
  return work;
}

// Makes two passes over pairs. The first (pair_tiles.cu) computes the cosines of a tile of pairs at
// all scales in registers, decides with them which pairs count, and stores a word of bits for each
// pair. The second (pair_gradients.cu) multiplies those bits with the features. The means need the
// numbers of positives and negatives, which are known between the two; a single pass would have to
// keep the gradients of both apart.
void CudaBackend::PairLoss(const PairLossArgs& args) {
  const Turn turn(*this);
  if (!turn) return;
  if (args.scales.size < 1 || args.scales.size > kMaxScales || args.pixel_weight.size >= 1 << 16) {
    return Fail({"PairLoss: " + std::to_string(args.scales.size) + " scales and " +
                 std::to_string(args.pixel_weight.size) + " pixels; the limits are 1 to " +
                 std::to_string(kMaxScales) + " scales and 65535 pixels"});
  }
  Arena sizes;
  TakePairWork(args, sizes);
  Arena arena(Temporary(sizes.num_bytes()));
  if (!error_.empty()) return;
  const PairWork work = TakePairWork(args, arena);
  Zero(work.counts, sizeof(PairCounts));
  LaunchPairPlan(work, stream_);
  Launched("pair plan");
  if (work.num_pixels > 0) {
    LaunchPairTiles(work, stream_);
    Launched("pair tiles");
    LaunchUnitGradients(work, stream_);
    Launched("unit gradients");
    LaunchPixelGradients(work, stream_);
    Launched("pixel gradients");
  }
  LaunchPairSums(work, stream_);
  Launched("pair sums");
}

}  // namespace pepeseg
