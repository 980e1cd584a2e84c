#include "core/train/snapshots.h"

#include <limits>

#include "core/base/status_macros.h"

namespace pepeseg {

Snapshots::Snapshots(FeatureTrainer& trainer, TrainingObserver& observer)
    : trainer_(trainer),
      observer_(observer),
      schedule_(observer.FirstSnapshotSeconds().value_or(std::numeric_limits<double>::infinity()),
                kMaxSnapshotCost) {}

double Snapshots::Seconds() {
  const Clock::time_point now = Clock::now();
  if (!start_) start_ = now;
  return std::chrono::duration<double>(now - *start_).count();
}

absl::Status Snapshots::TakeIfDue(const StepReport& report) {
  const double start = Seconds();
  // Where steps are queued, a report may be of a step before the trainer's last one.
  if (report.step != trainer_.step() || trainer_.done()) return absl::OkStatus();
  if (!schedule_.Due(start)) return absl::OkStatus();
  RETURN_IF_ERROR(observer_.KeepSnapshot({report.step, report.num_steps, trainer_.Snapshot()}));
  schedule_.Record(start, Seconds());
  return absl::OkStatus();
}

}  // namespace pepeseg
