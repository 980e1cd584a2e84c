#pragma once

#include <vector>

#include "kernels/backend.h"
#include "tests/kernels/pair_reference.h"

namespace pepeseg {

// What PairLoss gives for a batch.
struct PairOpResult {
  std::vector<double> sums = std::vector<double>(kNumPairLossSums);
  std::vector<float> feature_grad, gate_grad;

  double Total() const;
};
PairOpResult RunPairLoss(Backend& backend, const PairBatch& batch, float easy_share);

// Pixels of three patches: 0 and 1 agree at one of two scales, 2 with nothing, each with itself
// always. Nothing violates: features are equal within a patch and orthogonal between them.
PairBatch PatchesBatch(int size0, int size1, int size2);

}  // namespace pepeseg
