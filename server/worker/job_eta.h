#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/train/stage_plan.h"

namespace pepeseg {

// Estimates when a job ends.
//
// The rest of the running stage is extrapolated from its own pace: seconds so far, divided by the
// expected work of the steps so far, times the expected work of the steps to come. Later stages
// take their expected seconds, times the ratio of measured to expected seconds of the stages on the
// same processor (host or device) so far. The result is smoothed: the predicted end moves towards a
// new estimate over about a tenth of the time that is left, so that one slow step changes little.
//
// There is no estimate before a stage has measured its pace, nor while a stage of unknown length is
// still to come. Times are seconds on one monotonic clock. Not thread safe.
class JobEta {
 public:
  // Sets the stages that run, in order. May be called again when more is known: the running stage
  // is found again by its name.
  void Plan(std::vector<PlannedStage> stages);

  // Ends the running stage and starts another. A stage that is not planned has no number.
  void StartStage(const std::string& name, double now);
  void EndStage(double now);

  // Records that the running stage, which an earlier attempt left at `first_step`, has done `step`
  // of `num_steps` steps. `num_steps` may fall when the stage leaves steps out: the steps to come
  // are then the last ones of the plan.
  void Step(int64_t first_step, int64_t step, int64_t num_steps, double now);
  // Records the share of the work that the running stage has done, [0, 1].
  void Share(double share, double now);

  // Seconds left of the running stage; absent: it has no pace yet.
  std::optional<double> StageSecondsLeft() const;
  // Seconds left of the job, smoothed up to `now`; absent: no estimate.
  std::optional<double> SecondsLeft(double now);

  // Number of the running stage among those planned, from 1; 0: not planned.
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
  std::string name_;  // of the running stage
  int current_ = -1;  // its index in stages_
  double stage_start_ = 0;
  double elapsed_ = 0;          // of the running stage at its newest step
  double done_ = 0, left_ = 1;  // shares of its expected work
  bool measured_ = false;       // the running stage's pace is known
  Pace ended_[2];               // by on_device, of stages that are over
  std::optional<double> end_;   // predicted, smoothed
  double last_ = 0;             // when end_ was moved
};

}  // namespace pepeseg
