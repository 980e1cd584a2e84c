#pragma once

#include <cstdint>

namespace pepeseg {

// Decides whether the depth priors fit the scene at all (METHOD.md section 1.4): a prior that is
// upside down, constant or noise teaches nothing and costs a rendered channel.
class DepthAgreement {
 public:
  // min_share: smallest share of a window's comparisons that must agree, in [0, 1]. 0: never fails.
  explicit DepthAgreement(double min_share) : min_share_(min_share) {}

  // Adds a comparison of a view's prior with its rendered depth; to be called in the order of the
  // steps. explained: share of the prior's spread that the fit explains, <= 1; 0 without a fit.
  void Add(double explained);
  // Ends a window of steps and begins the next one. Returns true when fewer than min_share agreed
  // in this window and in the one before. One such window does not suffice: the scene may not have
  // taken shape yet.
  bool Failed();

  // State for checkpoints.
  struct State {
    int64_t num = 0, num_agreeing = 0;  // comparisons in the present window
    int64_t failed_before = 0;          // 1: fewer than min_share agreed in the window before
  };
  const State& state() const { return state_; }
  void Restore(const State& state) { state_ = state; }

 private:
  double min_share_;
  State state_;
};

}  // namespace pepeseg
