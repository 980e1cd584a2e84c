#include "core/reconstruct/depth_agreement.h"

namespace pepeseg {
namespace {

// Of noise 0.02 at most, of monocular priors 0.5 and more.
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
