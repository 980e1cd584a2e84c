#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/train/train.h"

namespace pepeseg {

// Estimates when a job ends.
//
// The rest of the running stage is extrapolated from its own pace: seconds so far, divided by the
// expected work of the steps so far, times the expected work of the remaining steps. Seconds before
// the first report are left out if it comes before a hundredth of the work. A later stage
// takes its expected seconds, times the ratio of measured to expected seconds of the earlier stages
// on the same processor (host or device). The result is smoothed: the predicted end moves towards a
// new estimate over about a tenth of the remaining time, so that one slow step changes little.
//
// There is no estimate before a stage has a pace, nor while a stage of unknown length is still to
// come. Times are seconds on one monotonic clock. Not thread safe.
class JobEta {
 public:
  // Sets the stages that run, in order. May be called again when more is known; the running stage
  // is then found again.
  void Plan(std::vector<PlannedStage> stages);

  // Ends the running stage and starts another. A stage that is not in the plan gets no number, and
  // no estimate of the job.
  void StartStage(Stage stage, double now);
  void EndStage(double now);

  // Records that the running stage, which an earlier attempt left after `first_step` steps, has
  // done `step` of `num_steps` steps. `num_steps` may fall when the stage leaves steps out; the
  // remaining steps are then the last ones of the plan.
  void Step(int64_t first_step, int64_t step, int64_t num_steps, double now);
  // Records the share of its work that the running stage has done, in [0, 1].
  void Share(double share, double now);

  // Returns the remaining seconds of the running stage; nothing if it has no pace yet.
  std::optional<double> StageSecondsLeft() const;
  // Returns the remaining seconds of the job, smoothed up to `now`; nothing if there is no
  // estimate.
  std::optional<double> SecondsLeft(double now);

  // Returns the number of the running stage in the plan, from 1; 0: it is not in the plan.
  int stage_number() const { return current_ + 1; }
  int num_stages() const { return static_cast<int>(stages_.size()); }

 private:
  // Measured and expected seconds of the stages on one kind of processor.
  struct Pace {
    double seconds = 0, expected = 0;
  };

  void Measure(double done, double left, double now);
  double SpeedOf(bool on_device) const;
  std::optional<double> RawSecondsLeft() const;

  std::vector<PlannedStage> stages_;
  std::optional<Stage> running_;  // absent: none has started
  int current_ = -1;              // its index in stages_
  double stage_start_ = 0;
  double elapsed_ = 0;          // seconds of the running stage up to its newest step
  double done_ = 0, left_ = 1;  // shares of its expected work that are done, and that remain
  Pace origin_;                 // seconds and share of the stage from which its pace counts
  bool reported_ = false;       // the running stage has reported a step
  bool has_share_ = false;      // enough of the stage is done since then for a pace
  bool measured_ = false;       // the running stage has a pace, over enough seconds
  Pace ended_[2];               // sums over the stages that have ended, by on_device
  std::optional<double> end_;   // predicted end, smoothed
  double last_ = 0;             // when end_ was last moved
};

}  // namespace pepeseg
