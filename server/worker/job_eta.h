#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace pepeseg {

// A stage that a job will run.
struct PlannedStage {
  // A run of the stage's steps that cost about the same.
  struct Piece {
    int64_t num_steps = 0;
    double seconds_per_step = 0;
  };

  std::string name;
  // Expected seconds, on the processor that `on_device` names. Absent: not known before it runs.
  std::optional<double> seconds = {};
  bool on_device = false;          // computes on the job's device, else on the host's cores
  std::vector<Piece> pieces = {};  // in order; empty: all steps cost the same
};

// Estimates when a job ends.
//
// What is left of the stage that runs is taken from its own pace: seconds so far over the expected
// work of the steps so far, times the expected work of the steps to come. Later stages take their
// expected seconds, times how much slower or faster than expected the stages on the same processor
// (host or device) were so far. The result is smoothed: the predicted end moves towards a new
// estimate over about a tenth of the time that is left, so that one slow step changes little.
//
// There is no estimate before a stage has measured its pace, and while a stage of unknown length is
// to come. Times are seconds on one clock that never goes back. Not thread safe.
class JobEta {
 public:
  // The stages that run, in order. May be called again when more is known; stages that are over
  // stay over.
  void Plan(std::vector<PlannedStage> stages);

  // Ends the stage before. A stage that is not planned has no number.
  void StartStage(const std::string& name, double now);
  void EndStage(double now);

  // Steps of the running stage. `done` counts from where an earlier attempt ended, `first_step`;
  // `num_steps` may fall when a stage leaves steps out: those to come are the schedule's last.
  void Step(int64_t first_step, int64_t step, int64_t num_steps, double now);
  // The same for a stage that knows its share of the work.
  void Share(double share, double now);

  // Of the running stage; absent: no pace yet.
  std::optional<double> StageSecondsLeft() const;
  // Of the job, smoothed up to `now`.
  std::optional<double> SecondsLeft(double now);

  // Place of the running stage among those planned, from 1; 0: not planned.
  int stage_number() const { return current_ + 1; }
  int num_stages() const { return static_cast<int>(stages_.size()); }

 private:
  // Of a stage on one kind of processor that has measured its pace.
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
