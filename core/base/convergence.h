#pragma once

#include <cmath>

namespace pepeseg {

// Whether a training still learns: the mean loss of one window of steps against that of the window
// before. Losses are those of the views trained on, so that windows must have whole rounds of them.
class Convergence {
 public:
  // min_fall: by what share of itself the loss must fall from a window to the next, or it has
  // stopped falling; 0: it never has.
  explicit Convergence(double min_fall) : min_fall_(min_fall) {}

  // The shortest window of whole rounds of so many views, steps.
  static int Window(int num_views) {
    constexpr int kShortest = 500;
    const int round = num_views > 0 ? num_views : 1;
    return (kShortest + round - 1) / round * round;
  }

  // Of each step; one that is not finite counts as none.
  void Add(double loss) {
    if (!std::isfinite(loss)) return;
    state_.sum += loss;
    state_.num += 1;
  }

  // At the end of a window: begins the next one.
  bool StoppedFalling() {
    const double mean = state_.num > 0 ? state_.sum / state_.num : 0;
    const bool stopped = min_fall_ > 0 && state_.before != 0 &&
                         mean > state_.before - min_fall_ * std::abs(state_.before);
    state_ = {0, 0, mean};
    return stopped;
  }

  // Where it stands, for checkpoints.
  struct State {
    double sum = 0;
    double num = 0;
    double before = 0;  // mean of the window before; 0: there was none
  };
  const State& state() const { return state_; }
  void Restore(const State& state) { state_ = state; }

 private:
  double min_fall_;
  State state_;
};

}  // namespace pepeseg
