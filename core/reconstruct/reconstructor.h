#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <random>

#include "absl/status/statusor.h"
#include "core/base/progress.h"
#include "core/reconstruct/densifier.h"
#include "core/reconstruct/depth_term.h"
#include "core/reconstruct/free_space.h"
#include "core/reconstruct/gaussian_state.h"
#include "core/reconstruct/initial_gaussians.h"
#include "core/reconstruct/options.h"
#include "core/reconstruct/reconstruct_checkpoint.h"
#include "core/reconstruct/refiner.h"
#include "core/reconstruct/scene_needs.h"
#include "core/reconstruct/schedule.h"
#include "core/reconstruct/step_queue.h"
#include "core/reconstruct/training_views.h"
#include "kernels/backend.h"

namespace pepeseg {

// Stage one, step by step (METHOD.md section 1); Reconstruct() is the loop around it. To be used by
// one thread at a time. The backend must outlive it, the capture need not.
//
// The host queues steps ahead of the device (step_queue.h). Before a decision that depends on
// these reports it waits for all of them, so that the decision does not depend on timing.
class Reconstructor {
 public:
  // Returns INVALID_ARGUMENT for the options, FAILED_PRECONDITION for a capture that cannot be
  // trained on, and RESOURCE_EXHAUSTED when the backend is out of memory.
  static absl::StatusOr<std::unique_ptr<Reconstructor>> Create(Backend& backend,
                                                               const Capture& capture,
                                                               const ReconstructOptions& options);

  // Resumes from a checkpoint of the same capture and options. Returns DATA_LOSS when Validate
  // refuses the checkpoint or when it cannot be of this capture and these options; other errors are
  // those of Create.
  static absl::StatusOr<std::unique_ptr<Reconstructor>> Resume(
      Backend& backend, const Capture& capture, const ReconstructOptions& options,
      const ReconstructCheckpoint& checkpoint);

  // Skipped parts of the stage, in the order of the decisions. After Resume, parts skipped before
  // the checkpoint are missing.
  const std::vector<SkippedPart>& skipped() const { return skipped_; }
  // By training view, whether its photograph is blurred (blurred_views.h) and trained on less for
  // it. Empty: none is.
  const std::vector<bool>& blurred() const { return blurred_; }
  // True when the schedule's options.num_steps steps have been done or skipped.
  bool done() const { return position_ >= options_.num_steps; }
  // Does the next steps, each on one view: StepsAtOnce of them, or fewer where density control or
  // another change of the Gaussians is due or the schedule ends. The loss and PSNR in the report
  // are those of the newest step that the device has finished, which may be several steps back.
  // Returns INTERNAL with the backend's error, and the errors of Densifier::Apply and
  // Refiner::Apply.
  absl::StatusOr<StepReport> Step();
  // Returns the state between two steps. Waits for the backend and returns INTERNAL with its error.
  absl::StatusOr<ReconstructCheckpoint> Save();
  // Returns the Gaussians as they are now. Waits for the backend.
  Gaussians Result() const { return state_.Download(); }

 private:
  Reconstructor(Backend& backend, const Capture& capture, const ReconstructOptions& options);

  absl::Status Allocated() const;
  absl::Status CheckMatches(const ReconstructCheckpoint& checkpoint) const;
  absl::Status Restore(const ReconstructCheckpoint& checkpoint);
  bool ChangesGaussiansAfter(int position) const;
  int EndOfSteps() const;
  StepInput DrawStep(int position);
  void ReadOldest();
  void ReadAll();
  double LossOf(const StepResult& result) const;
  double DepthExplained(const StepResult& result) const;
  void DropUnneededParts();
  absl::Status Refine(const StepInput& input);
  absl::Status ClearFreeSpace();
  Dropout DropoutOf(int step, int position) const;
  float NearPlane() const;
  absl::StatusOr<StepReport> Report() const;

  Backend& backend_;
  const ReconstructOptions options_;
  std::vector<SkippedPart> skipped_;
  const double scene_radius_;
  std::mt19937_64 random_;
  const std::vector<ScenePoint> points_;
  const Schedule schedule_;
  Refiner refiner_;
  const TrainingViews views_;
  const std::vector<bool> blurred_;  // by training view; empty where blurred ones count like others
  ViewSampler sampler_;
  const LogScaleBounds log_scales_;
  const FreeSpace free_space_;
  GaussianState state_;
  const Densifier densifier_;
  DepthTerm depth_term_;
  StepQueue queue_;
  int step_ = 0;      // steps done
  int position_ = 0;  // schedule position: steps done and skipped
  SceneNeeds needs_;
  std::optional<StepResult> newest_;  // result of the newest step that the device has finished
  // Totals since the start of the stage, see StepReport.
  int64_t num_culled_degenerate_ = 0, num_skipped_gradients_ = 0, num_overflowed_renders_ = 0;
  int64_t num_skipped_depths_ = 0;
};

}  // namespace pepeseg
