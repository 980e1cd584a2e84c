#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <future>
#include <memory>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/base/progress.h"
#include "core/features/options.h"
#include "core/reconstruct/options.h"
#include "core/reconstruct/trainer.h"
#include "core/scene/capture.h"
#include "core/scene/model.h"
#include "core/train/training_observer.h"
#include "kernels/backend.h"

namespace pepeseg {

// A first model for clicks, from Gaussians that stage one has not finished. Once the stage has seen
// each photograph a number of times, a thread trains a field for a copy of the Gaussians, by few
// steps and from few views, with a queue of the device of its own, and writes both as a model. The
// stage itself trains the same, but shares the device for that time. Measured:
// tests/bench/results/snapshots.md.
//
// Without a second queue (Backend::MakeTwin), masks or room on the device there is none, and a
// field that cannot be trained or written costs nothing but itself. For one thread.
class EarlyField {
 public:
  // What the thread works on.
  struct Scene {
    const Capture& capture;
    Model described;  // without Gaussians and field, see DescribeModel
    FeatureOptions features;
    std::filesystem::path folder;  // gets the model
  };

  // trainer: of stage one. twin: of the backend that it trains on; null: there will be no field.
  // The capture, the trainer and the observer must outlive it. The backend must outlive it, too.
  EarlyField(Scene scene, GaussianTrainer& trainer, std::unique_ptr<Backend> twin,
             TrainingObserver& observer);
  // Gives the field up if it is not done, and waits for the thread.
  ~EarlyField();
  EarlyField(const EarlyField&) = delete;
  EarlyField& operator=(const EarlyField&) = delete;

  // Called after each report of the trainer. Starts the thread when it is time.
  void Advance(const StepReport& report);

 private:
  // Makes the model of these Gaussians, as the thread does.
  absl::Status Make(Gaussians gaussians, const StepReport& at) const;

  const Scene scene_;
  GaussianTrainer& trainer_;
  const std::unique_ptr<Backend> twin_;
  TrainingObserver& observer_;
  const int64_t num_views_;  // that stage one trains on
  bool wanted_;
  std::atomic<bool> stopped_ = false;
  std::future<absl::Status> made_;  // valid while the thread works, and until its end is logged
};

// Returns the second queue on which an early field can be trained while stage one trains the
// capture; null: the backend has none, no training view has a mask, or the device lacks the room
// that stage one may still need, next to that of the field.
std::unique_ptr<Backend> QueueForEarlyField(const Backend& backend, const Capture& capture,
                                            const ReconstructOptions& reconstruct,
                                            const FeatureOptions& features);

}  // namespace pepeseg
