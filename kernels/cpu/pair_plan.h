#pragma once

#include <vector>

#include "kernels/cpu/feature_jobs.h"

namespace pepeseg {

// Everything of PairLoss that does not depend on features, and the working memory of its passes.
// `job` points into the plan and into `args`, which must outlive it.
struct PairPlan {
  explicit PairPlan(const PairLossArgs& args);

  PairJob job;

 private:
  void GateScales(const PairLossArgs& args);
  void ComparePatches(const PairLossArgs& args);
  void LimitDraws(const PairLossArgs& args);
  void ScaleWeights(const PairLossArgs& args);

  std::vector<float> psi_, pixel_weight_, unit_, unit_by_channel_, unit_grad_;
  std::vector<int32_t> patch_;
  std::vector<uint32_t> agrees_;
};

}  // namespace pepeseg
