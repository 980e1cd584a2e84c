#pragma once

#include <vector>

#include "core/features/loss_term.h"
#include "kernels/backend.h"

namespace pepeseg {

// The perception loss (METHOD.md section 3, "Perception loss") of the pairs that PerceptionCues
// lists.
class PerceptionTerm final : public LossTerm {
 public:
  // The backend must outlive it. weight: of the loss.
  PerceptionTerm(Backend& backend, float weight)
      : backend_(backend), weight_(weight), losses_(backend, kMaxUnreadFeatureSteps) {}

  bool IsIn(const RowChunk::Step& step) const override { return !step.pair_other.empty(); }
  void AddGradients(const RowChunk::Step& step, const Spans& spans, int unread_step) override;
  std::vector<double> ReadLosses(int num_steps) override;

 private:
  Backend& backend_;
  const float weight_;
  Buffer<double> losses_;  // [kMaxUnreadFeatureSteps] 0 where a step has no pair
};

}  // namespace pepeseg
