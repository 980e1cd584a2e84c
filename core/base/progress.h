#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "core/base/stage.h"

namespace pepeseg {

// A part of a stage that is skipped, because this scene does not need it or its options disable it.
struct SkippedPart {
  Part part;
  std::string reason;       // for a person
  int64_t step = 0;         // number of steps done when that was decided; 0: at the start
  int64_t saved_steps = 0;  // steps that are not run because of it
};

// Progress of a stage, reported after each step. NaN: not measured in this step. `num_gaussians`
// is the current number; the counts after it run from the start of the stage.
struct StepReport {
  int64_t step = 0;  // from 1
  int64_t num_steps = 0;
  double loss = std::numeric_limits<double>::quiet_NaN();
  double psnr = std::numeric_limits<double>::quiet_NaN();  // of the training view of this step, dB
  int64_t num_gaussians = 0;
  int64_t num_culled_degenerate = 0;
  int64_t num_skipped_gradients = 0;
  int64_t num_overflowed_renders = 0;  // steps repeated, see RenderArgs::tile_entry_capacity
  int64_t num_refined = 0;             // Gaussians that refinement shortened
  int64_t num_refine_split = 0;        // Gaussians that refinement added
  int64_t num_skipped_depths = 0;      // steps in which the view's depth could not be fitted
  double depth_loss = std::numeric_limits<double>::quiet_NaN();  // weighted; not part of `loss`
  // Words for "matching 19 of 60 pairs"; they must be literals. Both empty: a plain count of steps.
  std::string_view activity = {}, unit = {};
  // Share of the stage's work that is done, in [0, 1]. NaN: step / num_steps.
  double share = std::numeric_limits<double>::quiet_NaN();
};

// Reports of consecutive steps, the oldest first.
using StepReports = std::vector<StepReport>;

// Called after each step, on the thread of the stage. An error that it returns, such as CANCELLED,
// ends the stage with that error.
using ProgressFn = absl::FunctionRef<absl::Status(const StepReport&)>;

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
