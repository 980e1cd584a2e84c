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
// thread-safe.
class StageLog {
 public:
  using Metrics = std::map<std::string, double>;

  // `observer` must outlive it.
  explicit StageLog(TrainingObserver& observer) : observer_(observer) {}

  TrainingObserver& observer() { return observer_; }
  const std::string& stage() const { return stage_; }
  // Returns the metrics of all stages so far, with "seconds_STAGE" and "core_seconds_STAGE" of
  // each. Core seconds are those of the whole process and its children, such as SAM next to COLMAP.
  const Metrics& metrics() const { return metrics_; }

  // Starts a stage. Returns CANCELLED when the training was cancelled.
  absl::Status Start(const std::string& stage);
  // Ends the stage. metrics: measurements of its result, which become metrics of the model.
  absl::Status End(const Metrics& metrics = {});
  // Ends stage "evaluate", with the scores of the held-out views.
  absl::Status EndScored(const Metrics& metrics, std::vector<ViewScores> views);
  // Ends a stage that was started and has a result that it did not compute, because of `why`.
  absl::Status EndSkipped(const Metrics& metrics, const std::string& why);
  // Reports a stage that need not run, because of `why` ("given").
  absl::Status Skip(const std::string& stage, const std::string& why);

  // Reports a step of the stage. Returns CANCELLED when the training was cancelled.
  absl::Status Step(const StepReport& report);
  // Does the same for a caller that calls more often than once a step: reports only if the step or
  // the activity differs from the previous call's.
  absl::Status StepIfNew(const StepReport& report);
  // Reports the parts in `skipped` that were not reported before in this stage. The list only
  // grows.
  absl::Status ReportSkipped(std::span<const SkippedTerm> skipped);

  void Warn(const std::string& message) { observer_.Warn(message); }
  // Warns with the first 100 messages and the number of further ones.
  void WarnOfAll(std::span<const std::string> messages);

 private:
  absl::Status Finish(StageEnd end);

  TrainingObserver& observer_;
  std::string stage_;
  size_t num_skipped_ = 0;  // skipped parts reported in the stage
  std::chrono::steady_clock::time_point start_;
  int64_t last_step_ = 0;           // of the previous StepIfNew
  std::string_view last_activity_;  // of the previous StepIfNew
  double core_seconds_before_ = 0;
  Metrics metrics_;
};

}  // namespace pepeseg
