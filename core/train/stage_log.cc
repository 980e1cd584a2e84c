#include "core/train/stage_log.h"

#include <sys/resource.h>

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

constexpr int64_t kStepsPerLook = 50;
constexpr size_t kMaxWarnings = 100;  // most warnings of one list; further ones are only counted

// Returns the user and system time of this process and of the programs that it has run, summed over
// all cores, seconds.
double CoreSeconds() {
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  double sum = 0;
  // Children count once they have been waited for: COLMAP and the priors command.
  for (const auto who : {RUSAGE_SELF, RUSAGE_CHILDREN}) {
    rusage usage{};
    getrusage(who, &usage);
    sum += seconds(usage.ru_utime) + seconds(usage.ru_stime);
  }
  return sum;
}

}  // namespace

absl::Status StageLog::Start(Stage stage) {
  stage_ = stage;
  look_ = nullptr;
  num_skipped_ = 0;
  last_step_ = 0;
  last_activity_ = {};
  core_seconds_before_ = CoreSeconds();
  start_ = std::chrono::steady_clock::now();
  if (observer_.IsCancelled()) {
    return absl::CancelledError(absl::StrCat("stopped before stage ", NameOf(stage)));
  }
  return observer_.StartStage(stage);
}

// Adds the stage's times to its metrics, keeps these, and reports the end.
absl::Status StageLog::Finish(StageEnd end) {
  const auto passed = std::chrono::steady_clock::now() - start_;
  end.stage = stage_;
  const auto index = static_cast<size_t>(stage_);
  end.metrics.seconds[index] = std::chrono::duration<double>(passed).count();
  end.metrics.core_seconds[index] = CoreSeconds() - core_seconds_before_;
  metrics_.Merge(end.metrics);
  return observer_.EndStage(end);
}

absl::Status StageLog::End(const TrainingMetrics& metrics) { return Finish({.metrics = metrics}); }

absl::Status StageLog::EndScored(const TrainingMetrics& metrics, std::vector<ViewScores> views) {
  return Finish({.metrics = metrics, .views = std::move(views)});
}

absl::Status StageLog::EndSkipped(const TrainingMetrics& metrics, const std::string& why) {
  return Finish({.metrics = metrics, .skipped = why});
}

// A skipped stage has no times: it did not run.
absl::Status StageLog::Skip(Stage stage, const std::string& why) {
  RETURN_IF_ERROR(Start(stage));
  return observer_.EndStage({.stage = stage, .skipped = why});
}

void StageLog::ResumeAt(int64_t step) {
  observer_.ResumeStage(step);
  (stage_ == Stage::kReconstruct ? metrics_.resumed_from_step
                                 : metrics_.features_resumed_from_step) = static_cast<double>(step);
}

absl::Status StageLog::Step(const StepReport& report) {
  if (observer_.IsCancelled()) {
    return absl::CancelledError(absl::StrCat("stopped in stage ", NameOf(stage_), " at step ",
                                             report.step, " of ", report.num_steps));
  }
  RETURN_IF_ERROR(observer_.Step(report));
  if (look_ && report.step % kStepsPerLook == 0) look_();
  return absl::OkStatus();
}

// Cancellation is checked in every call, also when there is nothing new to report.
absl::Status StageLog::StepIfNew(const StepReport& report) {
  const bool is_new = report.step != last_step_ || report.activity != last_activity_;
  if (!is_new && !observer_.IsCancelled()) return absl::OkStatus();
  last_step_ = report.step;
  last_activity_ = report.activity;
  return Step(report);
}

absl::Status StageLog::ReportSkipped(std::span<const SkippedPart> skipped) {
  // The lists of a stage only grow, so that those already reported are at their front.
  while (num_skipped_ < skipped.size()) {
    RETURN_IF_ERROR(observer_.SkipPart(skipped[num_skipped_++]));
  }
  return absl::OkStatus();
}

void StageLog::WarnOfAll(std::span<const std::string> messages) {
  const size_t num_reported = std::min(messages.size(), kMaxWarnings);
  for (const std::string& message : messages.first(num_reported)) Warn(message);
  if (num_reported < messages.size()) {
    Warn(absl::StrCat("and ", messages.size() - num_reported, " more warnings"));
  }
}

}  // namespace pepeseg
