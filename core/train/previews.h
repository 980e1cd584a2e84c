#pragma once

#include <chrono>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/base/progress.h"
#include "core/reconstruct/trainer.h"
#include "core/scene/capture.h"
#include "core/train/training_observer.h"

namespace pepeseg {

// When previews or snapshots of a stage are due. Times are seconds since the stage's start. After
// the first one the time since the start must have grown by a tenth, at least 2 s must have passed,
// and as long as the last one took, divided by `max_cost`. So all but the first one, and a preview
// at the end of the stage, cost at most that share of the time.
class PreviewSchedule {
 public:
  // `first`: when the first one is due.
  explicit PreviewSchedule(double first = 0, double max_cost = 0.01)
      : max_cost_(max_cost), next_(first) {}

  bool Due(double seconds) const { return seconds >= next_; }
  // Records a preview that was made between the times `start` and `end`.
  void Record(double start, double end);

 private:
  double max_cost_;
  double next_;
};

// Returns the index of the training view whose camera is nearest to the mean of the centres of all
// of them. The capture must have a training view.
size_t PreviewView(const Capture& capture);
// Returns the camera with a longer side of at most kMaxPreviewSide pixels.
Camera PreviewCamera(const Camera& camera);
// Encodes an RGB image as a JPEG of at most kMaxPreviewBytes, by a lower quality and then by fewer
// pixels; `image` becomes the image that was encoded. INVALID_ARGUMENT: see EncodeJpeg.
absl::StatusOr<std::string> EncodePreview(Image& image);

// Shows stage one to the observer while it trains, if the observer wants it. For one thread.
class Previews {
 public:
  // All must outlive it. The stage starts now.
  Previews(const Capture& capture, GaussianTrainer& trainer, TrainingObserver& observer);
  // Called after each report of the trainer. Renders a preview if one is due or the trainer is
  // done. A preview for which memory is short is left out. Other errors are those of
  // GaussianTrainer::Render and of the observer.
  absl::Status ShowIfDue(const StepReport& report);

 private:
  using Clock = std::chrono::steady_clock;
  double Seconds() const { return std::chrono::duration<double>(Clock::now() - start_).count(); }
  absl::Status Show(const StepReport& report);

  const View& view_;
  GaussianTrainer& trainer_;
  TrainingObserver& observer_;
  const Clock::time_point start_ = Clock::now();
  PreviewSchedule schedule_;
};

}  // namespace pepeseg
