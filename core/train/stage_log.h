#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "core/base/progress.h"
#include "core/train/training_observer.h"

namespace pepeseg {

// Reports the stages of a training to its observer, and keeps their metrics for the model. Not
// thread safe.
class StageLog {
 public:
  using Metrics = std::map<std::string, double>;

  // `observer` must outlive it.
  explicit StageLog(TrainingObserver& observer) : observer_(observer) {}

  TrainingObserver& observer() { return observer_; }
  const std::string& stage() const { return stage_; }
  // Of all stages so far, and "seconds_STAGE" and "core_seconds_STAGE" of each. Core seconds count
  // everything that the process and its children did meanwhile, such as SAM next to COLMAP.
  const Metrics& metrics() const { return metrics_; }

  // CANCELLED: the training was cancelled.
  absl::Status Start(const std::string& stage);
  // `metrics`: what the stage measured of its result. They are the model's, too.
  absl::Status End(const Metrics& metrics = {});
  // Ends stage "evaluate".
  absl::Status EndScored(const Metrics& metrics, std::vector<ViewScores> views);
  // Ends a stage that was started and has a result, but did not compute it.
  absl::Status EndSkipped(const Metrics& metrics, const std::string& why);
  // Reports a stage that need not run, because of `why` ("given").
  absl::Status Skip(const std::string& stage, const std::string& why);

  // Reports a step of the stage. CANCELLED: the training was cancelled.
  absl::Status Step(const StepReport& report);
  // The same for a caller that calls more often than it makes a step: reports a step or an activity
  // that is not that of the call before.
  absl::Status StepIfNew(const StepReport& report);
  // Reports those of `skipped` that were not reported before in this stage.
  absl::Status ReportSkipped(std::span<const SkippedTerm> skipped);

  void Warn(const std::string& message) { observer_.Warn(message); }
  // Reports the first 100 and how many more there are.
  void WarnOfAll(std::span<const std::string> messages);

 private:
  absl::Status Finish(StageEnd end);

  TrainingObserver& observer_;
  std::string stage_;
  size_t num_skipped_ = 0;  // parts reported in the stage
  std::chrono::steady_clock::time_point start_;
  int64_t last_step_ = 0;           // of StepIfNew
  std::string_view last_activity_;  // of StepIfNew
  double core_seconds_before_ = 0;
  Metrics metrics_;
};

}  // namespace pepeseg
