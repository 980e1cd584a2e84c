#pragma once

#include <cstdint>
#include <memory>
#include <random>
#include <vector>

#include "absl/status/statusor.h"
#include "core/base/progress.h"
#include "core/reconstruct/checkpoint.h"
#include "core/reconstruct/densifier.h"
#include "core/reconstruct/depth_term.h"
#include "core/reconstruct/gaussian_state.h"
#include "core/reconstruct/options.h"
#include "core/reconstruct/preparation.h"
#include "core/reconstruct/refiner.h"
#include "core/reconstruct/scene_needs.h"
#include "core/reconstruct/step_queue.h"
#include "core/reconstruct/step_tally.h"
#include "core/reconstruct/training_views.h"
#include "kernels/backend.h"

namespace pepeseg {

// Stage one (METHOD.md section 1), a few steps at a time; the twin of FeatureTrainer. To be used by
// one thread at a time. The backend must outlive it, the capture need not.
//
// The host queues steps ahead of the device (step_queue.h). Before a decision that depends on
// these reports it waits for all of them, so that the decision does not depend on timing.
class GaussianTrainer {
 public:
  using State = GaussianCheckpoint;
  using Product = Gaussians;

  // Returns INVALID_ARGUMENT for the options, FAILED_PRECONDITION for a capture that cannot be
  // trained on, and RESOURCE_EXHAUSTED when the backend is out of memory.
  static absl::StatusOr<std::unique_ptr<GaussianTrainer>> Create(Backend& backend,
                                                                 const Capture& capture,
                                                                 const ReconstructOptions& options);
  // Resumes from a checkpoint of the same capture and options. Returns DATA_LOSS when Validate
  // refuses the checkpoint or when it cannot be of this capture and these options; other errors are
  // those of Create.
  static absl::StatusOr<std::unique_ptr<GaussianTrainer>> Resume(
      Backend& backend, const Capture& capture, const ReconstructOptions& options,
      const GaussianCheckpoint& checkpoint);

  // Number of steps done.
  int64_t step() const { return step_; }
  // True when all steps of the schedule have been done or skipped.
  bool done() const { return position_ >= scene_.options.num_steps; }
  // Skipped parts, in the order of the decisions. After Resume, parts skipped before the checkpoint
  // are missing.
  const std::vector<SkippedPart>& skipped() const { return skipped_; }
  // By training view, whether its photograph is blurred (blurred_views.h) and trained on less for
  // it. Empty: none is.
  const std::vector<bool>& blurred() const { return scene_.blurred; }

  // Does the next steps, each on one view: StepsAtOnce of them, or fewer where density control or
  // another change of the Gaussians is due or the schedule ends. Must not be called once done().
  // Returns one report, of the last of them: its loss and PSNR are those of the newest step that
  // the device has finished, which may be several steps back. Returns INTERNAL with the backend's
  // error, or when there are more Gaussians than max_gaussians, for which memory was estimated; and
  // the errors of Densifier::Apply and Refiner::Apply.
  absl::StatusOr<StepReports> Step();
  // Returns the state between two steps. Waits for the backend and returns INTERNAL with its error.
  absl::StatusOr<GaussianCheckpoint> Save();
  // Renders a view of the Gaussians as they are now, as an RGB image. Changes nothing of the
  // training. Waits for the backend. INTERNAL: a step before has failed. RESOURCE_EXHAUSTED: the
  // backend is out of memory for the picture only; the training can continue.
  absl::StatusOr<Image> Render(const PinholeView& view);
  // Returns the Gaussians as they are now. Waits for the backend.
  Gaussians Result() const { return state_.Download(); }

 private:
  GaussianTrainer(Backend& backend, const Capture& capture, const ReconstructOptions& options);

  absl::Status CheckAllocated() const;
  absl::Status CheckMatches(const GaussianCheckpoint& checkpoint) const;
  absl::Status Restore(const GaussianCheckpoint& checkpoint);
  bool ChangesGaussiansAfter(int position) const;
  int EndOfSteps() const;
  StepInput DrawStep(int position);
  void ReadOldest();
  void ReadAll();
  double DepthExplained(const StepResult& result) const;
  void DropUnneededParts();
  absl::Status Refine(const StepInput& input);
  absl::Status ClearFreeSpace();
  Dropout DropoutOf(int step, int position) const;
  absl::StatusOr<StepReports> Report() const;

  Backend& backend_;
  std::mt19937_64 random_;
  const PreparedScene scene_;
  std::vector<SkippedPart> skipped_;
  ViewSampler sampler_;
  Refiner refiner_;
  GaussianState state_;
  const Densifier densifier_;
  DepthTerm depth_term_;
  StepQueue queue_;
  SceneNeeds needs_;
  StepTally tally_;
  int step_ = 0;
  int position_ = 0;  // schedule position: steps done and skipped
};

}  // namespace pepeseg
