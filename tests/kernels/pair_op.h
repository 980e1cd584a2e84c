#pragma once

#include <vector>

#include "kernels/backend.h"
#include "tests/kernels/pair_reference.h"

namespace pepeseg {

// Result of PairLoss on a batch.
struct PairOpResult {
  std::vector<double> sums = std::vector<double>(kNumPairLossSums);
  std::vector<float> feature_grad, gate_grad;
  bool joint_mean = false;  // of the batch

  double Total() const;
};
PairOpResult RunPairLoss(Backend& backend, const PairBatch& batch, float easy_share);

// A batch of three mask cells with this many pixels. Cells 0 and 1 agree at one of two scales, cell
// 2 agrees with no other, and each agrees with itself. No pair is wrong: features are equal within
// a cell and orthogonal between cells.
PairBatch PatchesBatch(int size0, int size1, int size2);

}  // namespace pepeseg
