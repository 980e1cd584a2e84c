#include "core/sfm/sfm_watch.h"

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"

namespace pepeseg {

SfmWatch::SfmWatch(const SfmLoad& load, const SfmOptions& options, ProgressFn report)
    : num_photographs_(static_cast<size_t>(load.num_photographs)),
      max_seconds_(options.max_seconds),
      deadline_(absl::Now() + absl::Seconds(options.max_seconds)),
      progress_(load.num_photographs, NumSfmPairs(load, options).compared,
                ExpectedSfmWork(load, options)),
      report_(report) {}

absl::Status SfmWatch::Report() {
  StepReport report;
  report.step = progress_.step();
  report.num_steps = progress_.num_steps();
  report.activity = progress_.activity();
  report.unit = progress_.unit();
  report.share = progress_.share();
  absl::Status status = report_(report);
  stopped_ |= !status.ok();
  return status;
}

absl::Status SfmWatch::ReportInTime(absl::string_view doing) {
  return absl::Now() > deadline_ ? TookTooLong(doing) : Report();
}

absl::Status SfmWatch::Run(const ColmapProgram& program, const ColmapProgram::Command& command) {
  absl::Status status = program.Run(command, deadline_, [this](std::span<const std::string> lines) {
    for (const std::string& line : lines) progress_.Read(line);
    return Report();
  });
  if (!absl::IsDeadlineExceeded(status)) return status;
  return TookTooLong(absl::StrCat("COLMAP was at its ", command.name));
}

absl::Status SfmWatch::TookTooLong(absl::string_view doing) {
  stopped_ = true;
  return absl::DeadlineExceededError(absl::StrCat(
      "poses of ", num_photographs_, " photographs were not found within ", max_seconds_,
      " s (sfm.max_seconds), ", doing,
      ": allow more, upload fewer photographs, or have fewer features (sfm.max_features)"));
}

}  // namespace pepeseg
