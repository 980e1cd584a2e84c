#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "core/base/progress.h"
#include "core/train/training_metrics.h"
#include "core/train/training_observer.h"

namespace pepeseg {

// Reports the stages of a training to its observer, and keeps their metrics for the model. Not
// thread-safe.
class StageLog {
 public:
  // `observer` must outlive it.
  explicit StageLog(TrainingObserver& observer) : observer_(observer) {}

  TrainingObserver& observer() { return observer_; }
  Stage stage() const { return stage_; }
  // Returns the metrics of all stages so far.
  const TrainingMetrics& metrics() const { return metrics_; }
  // Adds metrics that are no stage's results.
  void Add(const TrainingMetrics& metrics) { metrics_.Merge(metrics); }

  // Starts a stage. Returns CANCELLED when the training was cancelled.
  absl::Status Start(Stage stage);
  // Ends the stage. metrics: measurements of its result, which become metrics of the model.
  absl::Status End(const TrainingMetrics& metrics = {});
  // Ends stage "evaluate", with the scores of the held-out views.
  absl::Status EndScored(const TrainingMetrics& metrics, std::vector<ViewScores> views);
  // Ends a stage that was started and has a result that it did not compute, because of `why`.
  absl::Status EndSkipped(const TrainingMetrics& metrics, const std::string& why);
  // Reports a stage that need not run, because of `why` ("given").
  absl::Status Skip(Stage stage, const std::string& why);

  // Reports and records the step, over 0, that stage one or two resumes from.
  void ResumeAt(int64_t step);
  // Calls `look` after every 50th step of the running stage.
  void LookEveryFewSteps(std::function<void()> look) { look_ = std::move(look); }
  // Reports a step of the stage. Returns CANCELLED when the training was cancelled.
  absl::Status Step(const StepReport& report);
  // Does the same for a caller that calls more often than once per step: reports only if the step
  // or the activity differs from the previous call's.
  absl::Status StepIfNew(const StepReport& report);
  // Reports the parts in `skipped` that were not reported before in this stage. The list only
  // grows.
  absl::Status ReportSkipped(std::span<const SkippedPart> skipped);

  void Warn(const std::string& message) { observer_.Warn(message); }
  void WarnIf(const std::optional<std::string>& message) {
    if (message) Warn(*message);
  }
  // Warns with the first 100 messages and the number of further ones.
  void WarnOfAll(std::span<const std::string> messages);

 private:
  absl::Status Finish(StageEnd end);

  TrainingObserver& observer_;
  Stage stage_ = Stage::kPrepare;
  std::function<void()> look_;  // empty: there is nothing to look at
  size_t num_skipped_ = 0;      // skipped parts reported in the stage
  std::chrono::steady_clock::time_point start_;
  int64_t last_step_ = 0;           // of the previous StepIfNew
  std::string_view last_activity_;  // of the previous StepIfNew
  double core_seconds_before_ = 0;
  TrainingMetrics metrics_;
};

}  // namespace pepeseg
