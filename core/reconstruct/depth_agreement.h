#pragma once

#include <cstdint>

namespace pepeseg {

// Whether the depth priors are of this scene at all: one that is upside down, constant or noise
// teaches nothing, and costs a channel.
class DepthAgreement {
 public:
  // min_share: of the comparisons of a window that must agree; 0: any will do.
  explicit DepthAgreement(double min_share) : min_share_(min_share) {}

  // Of each comparison, in order. explained: share of the prior's spread that its best fit to the
  // rendered depth explains, <= 1; 0 where nothing fits.
  void Add(double explained);
  // At the end of a window of steps: begins the next one. True when too few have agreed in this
  // window and in the one before: one alone may be of a scene that is yet to take shape.
  bool Failed();

  // Where it stands, for checkpoints.
  struct State {
    int64_t num = 0, num_agreeing = 0;  // in the window
    int64_t failed_before = 0;          // 1: the window before was one of too few
  };
  const State& state() const { return state_; }
  void Restore(const State& state) { state_ = state; }

 private:
  double min_share_;
  State state_;
};

}  // namespace pepeseg
