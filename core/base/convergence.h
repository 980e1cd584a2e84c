#pragma once

#include <cmath>

namespace pepeseg {

// Decides whether a training still learns, by comparing the mean loss of one window of steps with
// that of the window before. A window should contain every training view equally often (see
// Window), or else the means differ because the views do. Not thread safe.
class Convergence {
 public:
  // `min_fall`: the loss counts as falling while its mean falls by at least this share of itself
  // from one window to the next. 0: StoppedFalling() is always false.
  explicit Convergence(double min_fall) : min_fall_(min_fall) {}

  // Returns the length of a window in steps: the smallest multiple of `num_views` that is at least
  // 500.
  static int Window(int num_views) {
    constexpr int kShortest = 500;
    const int round = num_views > 0 ? num_views : 1;
    return (kShortest + round - 1) / round * round;
  }

  // Records the loss of a step. Ignores losses that are not finite.
  void Add(double loss) {
    if (!std::isfinite(loss)) return;
    state_.sum += loss;
    state_.num += 1;
  }

  // Ends the window and begins the next one. Returns true if its mean loss is too high compared
  // with the window before; false for the first window.
  bool StoppedFalling() {
    const double mean = state_.num > 0 ? state_.sum / state_.num : 0;
    const bool stopped = min_fall_ > 0 && state_.before != 0 &&
                         mean > state_.before - min_fall_ * std::abs(state_.before);
    state_ = {0, 0, mean};
    return stopped;
  }

  // The state to save in checkpoints.
  struct State {
    double sum = 0;
    double num = 0;
    double before = 0;  // mean of the window before; 0: no window has ended
  };
  const State& state() const { return state_; }
  void Restore(const State& state) { state_ = state; }

 private:
  double min_fall_;
  State state_;
};

}  // namespace pepeseg
