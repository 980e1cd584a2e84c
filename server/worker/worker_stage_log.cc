#include "server/worker/worker_stage_log.h"

#include <spdlog/spdlog.h>
#include <sys/resource.h>

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

// More would drown the log; the rest is counted.
constexpr size_t kMaxWarnings = 100;

// Of this process and of the programs that it has run, on all cores together.
double CoreSeconds() {
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  double sum = 0;
  for (const auto who : {RUSAGE_SELF, RUSAGE_CHILDREN}) {
    rusage usage{};
    getrusage(who, &usage);
    sum += seconds(usage.ru_utime) + seconds(usage.ru_stime);
  }
  return sum;
}

}  // namespace

absl::Status StageLog::Start(const std::string& stage) {
  stage_ = stage;
  num_skipped_ = 0;
  core_seconds_before_ = CoreSeconds();
  if (stop_.stop) return absl::CancelledError("stopped before stage " + stage);
  spdlog::info("stage {} begins", stage);
  return progress_.StartStage(stage);
}

absl::Status StageLog::End(const std::map<std::string, double>& metrics,
                           v1::JobEvent::StageEnded end) {
  const double seconds = progress_.seconds_in_stage();
  spdlog::info("stage {} took {:.2f} s", stage_, seconds);
  std::map<std::string, double> told = metrics;
  told["seconds_" + stage_] = seconds;
  told["core_seconds_" + stage_] = CoreSeconds() - core_seconds_before_;
  for (const auto& [name, value] : told) metrics_[name] = value;
  return progress_.EndStage(told, std::move(end));
}

absl::Status StageLog::Skip(const std::string& stage, const std::string& why) {
  RETURN_IF_ERROR(Start(stage));
  spdlog::info("stage {} skipped: {}", stage, why);
  v1::JobEvent::StageEnded end;
  end.set_skipped(why);
  return progress_.EndStage({}, std::move(end));
}

absl::Status StageLog::Step(const StepReport& report) {
  if (stop_.stop) {
    return absl::CancelledError(absl::StrCat("stopped in stage ", stage_, " at step ", report.step,
                                             " of ", report.num_steps));
  }
  return progress_.Step(report);
}

absl::Status StageLog::TellSkipped(std::span<const SkippedTerm> skipped) {
  for (; num_skipped_ < skipped.size(); ++num_skipped_) {
    const SkippedTerm& term = skipped[num_skipped_];
    spdlog::info("stage {}, step {}: {} skipped: {} ({} steps saved)", stage_, term.step, term.term,
                 term.reason, term.saved_steps);
    RETURN_IF_ERROR(progress_.SkipTerm(term));
  }
  return absl::OkStatus();
}

void StageLog::Warn(const std::string& message) {
  spdlog::warn("{}", message);
  progress_.Warn(message).IgnoreError();  // it is in the worker's log
}

void StageLog::WarnOf(std::span<const std::string> messages) {
  const size_t num_told = std::min(messages.size(), kMaxWarnings);
  for (const std::string& message : messages.first(num_told)) Warn(message);
  if (num_told < messages.size()) {
    Warn(absl::StrCat("and ", messages.size() - num_told, " more warnings"));
  }
}

}  // namespace pepeseg
