#include "core/reconstruct/depth_agreement.h"

namespace pepeseg {
namespace {

// Share of the prior's spread that a fit must explain to agree. Noise reaches 0.02, monocular
// priors 0.5 and more.
constexpr double kAgrees = 0.2;

}  // namespace

void DepthAgreement::Add(double explained) {
  ++state_.num;
  state_.num_agreeing += explained > kAgrees;
}

bool DepthAgreement::Failed() {
  const bool failed = state_.num > 0 && static_cast<double>(state_.num_agreeing) <
                                            min_share_ * static_cast<double>(state_.num);
  const bool twice = failed && state_.failed_before != 0;
  state_ = {0, 0, failed ? 1 : 0};
  return twice;
}

}  // namespace pepeseg
