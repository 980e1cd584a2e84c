#include "core/features/perception_term.h"

#include <span>

namespace pepeseg {

void PerceptionTerm::AddGradients(const RowChunk::Step& step, const Spans& spans, int unread_step) {
  backend_.PerceptionLoss({.pixel_features = spans.pixel_features,
                           .first = step.pair_first,
                           .other = step.pair_other,
                           .cues = step.pair_cues,
                           .share = step.pair_share,
                           .scales = step.scales,
                           .gate = spans.gate,
                           .weight = weight_,
                           .pixel_grad = spans.pixel_grad,
                           .gate_grad = spans.gate_grad,
                           .loss = losses_.span().Subspan(unread_step, 1)});
}

std::vector<double> PerceptionTerm::ReadLosses(int num_steps) {
  std::vector<double> losses(static_cast<size_t>(num_steps));
  losses_.Download(std::span<double>(losses));
  losses_.Zero();
  for (double& loss : losses) loss *= double{weight_};
  return losses;
}

}  // namespace pepeseg
