#include "core/reconstruct/scene_needs.h"

#include <algorithm>
#include <cassert>

namespace pepeseg {
namespace {

// Share of num_steps after which SH degrees are measured. The last degree is in use from 3 / 30 of
// the steps on, so that all have been trained for a while.
constexpr double kPruneShFrom = 0.3;

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

SceneNeeds::SceneNeeds(const ReconstructOptions& options, int num_views)
    : options_(options),
      window_(Convergence::Window(num_views)),
      loss_(options.min_loss_fall),
      depth_(options.min_depth_agreement) {}

void SceneNeeds::RecordLoss(double loss) { loss_.Add(loss); }

// True when density control, smaller photographs and refinement are over after `step`: the loss is
// then comparable from window to window.
bool SceneNeeds::Grown(int step) const {
  const double share = static_cast<double>(step + 1) / options_.num_steps;
  return share >= std::max({options_.densify_until, options_.coarse_until,
                            options_.refine_from + options_.refine_length});
}

// Both agreement and convergence begin their next window here, whatever is decided.
SceneNeeds::Decision SceneNeeds::Decide(int step) {
  const double share = static_cast<double>(step + 1) / options_.num_steps;
  const double before = static_cast<double>(step + 1 - window_) / options_.num_steps;
  Decision decision;
  decision.leave_out_depth = depth_.Failed();
  // True in the one window in which the schedule passes kPruneShFrom.
  decision.prune_sh_degree =
      options_.min_band_gain > 0 && before < kPruneShFrom && share >= kPruneShFrom;
  decision.close = loss_.StoppedFalling() && Grown(step) && share < 1 - options_.closing_share;
  return decision;
}

// Save and Restore list the same six numbers in the same order.
std::vector<double> SceneNeeds::Save() const {
  const Convergence::State& loss = loss_.state();
  const DepthAgreement::State& depth = depth_.state();
  return {loss.sum,
          loss.num,
          loss.before,
          static_cast<double>(depth.num),
          static_cast<double>(depth.num_agreeing),
          static_cast<double>(depth.failed_before)};
}

void SceneNeeds::Restore(const std::vector<double>& state) {
  assert(state.size() == kNumState);
  loss_.Restore({state[0], state[1], state[2]});
  depth_.Restore({static_cast<int64_t>(state[3]), static_cast<int64_t>(state[4]),
                  static_cast<int64_t>(state[5])});
}

}  // namespace pepeseg
