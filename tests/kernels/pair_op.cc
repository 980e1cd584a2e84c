#include "tests/kernels/pair_op.h"

#include <algorithm>

#include "tests/kernels/test_scene.h"

namespace pepeseg {
namespace {

std::vector<float> Floats(const std::vector<double>& values) {
  return {values.begin(), values.end()};
}

}  // namespace

// The loss as the trainer computes it from the sums.
double PairOpResult::Total() const {
  const auto mean = [&](int sum, int count) {
    return sums[count] == 0 ? 0 : sums[sum] / sums[count];
  };
  const double joint = (sums[kPositiveLoss] + sums[kNegativeLoss]) /
                       std::max(1.0, sums[kNumPositives] + sums[kNumNegatives]);
  const double pairs =
      joint_mean ? joint : mean(kPositiveLoss, kNumPositives) + mean(kNegativeLoss, kNumNegatives);
  return pairs + mean(kNormLoss, kNumNormPixels);
}

PairOpResult RunPairLoss(Backend& backend, const PairBatch& batch, float easy_share) {
  const Buffer<float> features = Upload(backend, Floats(batch.features));
  const Buffer<float> weight = Upload(backend, Floats(batch.weight));
  const Buffer<float> alpha = Upload(backend, Floats(batch.alpha));
  const Buffer<float> scales = Upload(backend, Floats(batch.scales));
  const Buffer<float> gate = Upload(backend, Floats(batch.gate));
  const Buffer<int32_t> cell(backend, std::span<const int32_t>(batch.cell));
  const Buffer<uint64_t> labels(backend, std::span<const uint64_t>(batch.labels));
  Buffer<float> pixel_grad(backend, features.size()), gate_grad(backend, gate.size());
  Buffer<double> sums(backend, kNumPairLossSums);
  PairLossArgs args;
  args.pixel_features = features.span();
  args.pixel_weight = weight.span();
  args.pixel_alpha = alpha.span();
  args.pixel_cell = cell.span();
  args.labels = labels.span();
  args.num_cells = batch.num_cells;
  args.label_words = batch.label_words;
  args.scales = scales.span();
  args.gate = gate.span();
  args.negative_margin = batch.negative_margin;
  args.joint_mean = batch.joint_mean;
  args.easy_share = easy_share;
  args.pair_seed = 17;
  args.pixel_grad = pixel_grad.span();
  args.gate_grad = gate_grad.span();
  args.sums = sums.span();
  backend.PairLoss(args);
  PairOpResult out;
  out.joint_mean = batch.joint_mean;
  sums.Download(out.sums);
  out.feature_grad = Download(pixel_grad);
  out.gate_grad = Download(gate_grad);
  return out;
}

PairBatch PatchesBatch(int size0, int size1, int size2) {
  const int num_pixels = size0 + size1 + size2;
  PairBatch batch = RandomPairBatch(num_pixels, 2, 1, 5);
  batch.num_cells = 3;
  // By scale, then cell: 0 and 1 share a label at the first scale only.
  batch.labels = {1, 1, 2, 1, 4, 2};
  for (int i = 0; i < num_pixels; ++i) {
    batch.cell[i] = i < size0 ? 0 : (i < size0 + size1 ? 1 : 2);
    for (int k = 0; k < kFeatureSize; ++k) {
      batch.features[i * kFeatureSize + k] = k == batch.cell[i] ? 1 : 0;
    }
  }
  return batch;
}

}  // namespace pepeseg
