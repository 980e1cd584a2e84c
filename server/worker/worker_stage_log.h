#pragma once

#include <map>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "core/base/progress.h"
#include "server/worker/worker_job.h"
#include "server/worker/worker_progress.h"
#include "server/worker_protocol/event_log.h"

namespace pepeseg {

// What the stages of a job tell of themselves, in its events and in the worker's log. Not thread
// safe.
class StageLog {
 public:
  // `job` must outlive it.
  explicit StageLog(const WorkerJob& job) : stop_(job.stop), progress_(job.log) {}

  // The stages that are expected to run, for the ETA of the job. May be called again.
  void Plan(std::vector<PlannedStage> stages) { progress_.Plan(std::move(stages)); }
  // CANCELLED: the job was told to stop.
  absl::Status Start(const std::string& stage);
  // `metrics`: what the stage measured of its result; they are the model's, too.
  absl::Status End(const std::map<std::string, double>& metrics = {},
                   v1::JobEvent::StageEnded end = {});
  // A stage that need not run, because of `why` ("given").
  absl::Status Skip(const std::string& stage, const std::string& why);
  // A step of the stage. CANCELLED: the job was told to stop.
  absl::Status Step(const StepReport& report);
  // The stage goes on from what an earlier attempt did in `step` steps.
  void GoOnFrom(int64_t step) { progress_.GoOnFrom(step); }
  // Those that are behind what it was told of in this stage before.
  absl::Status TellSkipped(std::span<const SkippedTerm> skipped);
  void Warn(const std::string& message);
  // Not all of very many.
  void WarnOf(std::span<const std::string> messages);

  const std::string& stage() const { return stage_; }
  // Of all stages so far, and "seconds_STAGE" and "core_seconds_STAGE" of each: the latter of all
  // that the job did meanwhile, such as SAM next to COLMAP.
  const std::map<std::string, double>& metrics() const { return metrics_; }

 private:
  const StopSwitch& stop_;
  WorkerProgress progress_;
  std::string stage_;
  size_t num_skipped_ = 0;  // told of in the stage
  double core_seconds_before_ = 0;
  std::map<std::string, double> metrics_;
};

}  // namespace pepeseg
