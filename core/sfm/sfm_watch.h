#pragma once

#include <cstddef>
#include <string>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"
#include "absl/time/time.h"
#include "core/base/progress.h"
#include "core/sfm/colmap_program.h"
#include "core/sfm/sfm_options.h"
#include "core/sfm/sfm_progress.h"

namespace pepeseg {

// The progress and the time limit of a run of stage "sfm". Used on the thread of the stage.
class SfmWatch {
 public:
  // `report` is called with the progress several times a second. The time of options.max_seconds
  // starts now.
  SfmWatch(const SfmLoad& load, const SfmOptions& options, ProgressFn report);

  SfmProgress& progress() { return progress_; }
  const SfmProgress& progress() const { return progress_; }

  // Reports the progress. Returns the errors of `report`.
  absl::Status Report();
  // Reports the progress of a part that pepeseg does itself. DEADLINE_EXCEEDED, with what to do:
  // the time is over; `doing` says during what, as in "at matching features".
  absl::Status ReportInTime(absl::string_view doing);
  // Runs a command of COLMAP, whose output is read as progress. Errors of ColmapProgram::Run and of
  // `report`.
  absl::Status Run(const ColmapProgram& program, const ColmapProgram::Command& command);
  // Returns whether a method has returned an error of `report` or of the time limit: then the run
  // ends, and no other program is tried.
  bool stopped() const { return stopped_; }

 private:
  absl::Status TookTooLong(absl::string_view doing);

  size_t num_photographs_;
  int max_seconds_;
  absl::Time deadline_;
  SfmProgress progress_;
  ProgressFn report_;
  bool stopped_ = false;
};

}  // namespace pepeseg
