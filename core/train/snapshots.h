#pragma once

#include <chrono>
#include <optional>

#include "absl/status/status.h"
#include "core/base/progress.h"
#include "core/features/trainer.h"
#include "core/train/previews.h"
#include "core/train/training_observer.h"

namespace pepeseg {

// Gives the field of stage two to the observer while it trains, if the observer wants it. The
// training stays the same. For one thread.
class Snapshots {
 public:
  // Both must outlive it.
  Snapshots(FeatureTrainer& trainer, TrainingObserver& observer);
  // Called after each report of the trainer. Takes a snapshot if one is due, but none at the end of
  // the stage: the model is written then. Errors are those of the observer.
  absl::Status TakeIfDue(const StepReport& report);

 private:
  using Clock = std::chrono::steady_clock;
  // Returns the time since the first report. The first step may wait long for its batch, and a
  // field after one step means nothing.
  double Seconds();

  FeatureTrainer& trainer_;
  TrainingObserver& observer_;
  std::optional<Clock::time_point> start_;  // absent: no step was reported yet
  PreviewSchedule schedule_;
};

}  // namespace pepeseg
