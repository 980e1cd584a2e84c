#pragma once

#include <chrono>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "core/train/train.h"
#include "server/worker/job_eta.h"
#include "server/worker_protocol/event_log.h"

namespace pepeseg {

// Writes a stage's progress as events: the first and last step, each step with another activity,
// and between them at most one event per interval. Not thread safe.
class WorkerProgress {
 public:
  using Clock = std::chrono::steady_clock;

  // `log` must outlive it. `interval`: minimum time between two events of progress; the default is
  // as often as a person can follow.
  explicit WorkerProgress(EventLogWriter& log,
                          Clock::duration interval = std::chrono::milliseconds(200))
      : log_(log), interval_(interval) {}

  // Plans the job's ETA, see JobEta. Before this call, and in stages that are not in the plan,
  // events have no ETA of the job and no number of the stage.
  void Plan(std::vector<PlannedStage> stages) { eta_.Plan(std::move(stages)); }

  absl::Status StartStage(Stage stage);
  // Records that an earlier attempt did the first `step` steps of the stage. They do not count for
  // its pace.
  void ResumeAt(int64_t step);
  absl::Status Step(const StepReport& report);
  // Ends the stage with an event. `metrics`: what the stage measured of its result. `end`: the
  // other fields of the event.
  absl::Status EndStage(const TrainingMetrics& metrics, v1::JobEvent::StageEnded end = {});
  // Reports a part of the running stage that is skipped.
  absl::Status SkipPart(const SkippedPart& skipped);
  absl::Status ShowPreview(const Preview& preview);
  absl::Status Warn(const std::string& message);

  double seconds_in_stage() const;

 private:
  v1::JobProgress Describe(const StepReport& report);
  void DescribeTimes(const StepReport& report, v1::JobProgress& progress);
  double Now() const;

  EventLogWriter& log_;
  Clock::duration interval_;
  Stage stage_ = Stage::kPrepare;
  Clock::time_point stage_start_ = Clock::now();
  Clock::time_point last_event_;
  int64_t first_step_ = 0;  // number of steps that an earlier attempt did
  int64_t last_step_ = 0;   // step of the newest event
  std::string activity_;    // activity of the newest event
  JobEta eta_;
  double psnr_sum_ = 0;  // over the num_psnr_ steps since the newest event that measured it
  int64_t num_psnr_ = 0;
};

}  // namespace pepeseg
