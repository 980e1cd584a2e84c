#pragma once

#include <cstdint>
#include <vector>

#include "kernels/ops/feature.h"

namespace pepeseg {

// A batch for PairLoss on the host, in double. Easy pairs are either all drawn or none.
struct PairBatch {
  int num_pixels = 0, num_scales = 0, num_cells = 0, label_words = 1;
  std::vector<double> features, gate;  // [S, 32], [kGateSize] or [kTwoLayerGateSize]
  std::vector<double> weight, alpha, scales;
  std::vector<int32_t> cell;
  std::vector<uint64_t> labels;
  float negative_margin = 0;
  bool every_pair = false;  // false: hard and wrong pairs only
  bool joint_mean = false;  // see PairLossArgs
};

PairBatch RandomPairBatch(int num_pixels, int num_scales, int label_words, uint64_t seed);

// The losses of PairLoss and their gradients.
struct PairReference {
  double positive_loss = 0, negative_loss = 0, norm_loss = 0;  // sums
  double num_positives = 0, num_negatives = 0, num_norm_pixels = 0;
  bool joint_mean = false;  // of the batch
  std::vector<double> feature_grad, gate_grad;

  double Total() const {
    const auto mean = [](double sum, double count) { return count == 0 ? 0 : sum / count; };
    const double pairs =
        joint_mean ? mean(positive_loss + negative_loss, num_positives + num_negatives)
                   : mean(positive_loss, num_positives) + mean(negative_loss, num_negatives);
    return pairs + mean(norm_loss, num_norm_pixels);
  }
};

// Computes them straight from the definition, one pair and one scale at a time.
PairReference ComputePairReference(const PairBatch& batch);

}  // namespace pepeseg
