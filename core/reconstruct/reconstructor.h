#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <random>

#include "absl/status/statusor.h"
#include "core/base/progress.h"
#include "core/reconstruct/densifier.h"
#include "core/reconstruct/depth_term.h"
#include "core/reconstruct/entry_rooms.h"
#include "core/reconstruct/gaussian_state.h"
#include "core/reconstruct/initial_gaussians.h"
#include "core/reconstruct/reconstruct.h"
#include "core/reconstruct/reconstruct_checkpoint.h"
#include "core/reconstruct/refiner.h"
#include "core/reconstruct/scene_needs.h"
#include "core/reconstruct/schedule.h"
#include "core/reconstruct/step_results.h"
#include "core/reconstruct/training_views.h"
#include "core/reconstruct/view_sampler.h"
#include "kernels/backend.h"

namespace pepeseg {

// Stage one, step by step; Reconstruct() is the loop around it. One thread at a time; the backend
// must outlive it, the capture need not.
class Reconstructor {
 public:
  // INVALID_ARGUMENT for the options, FAILED_PRECONDITION for a capture that cannot be trained on.
  static absl::StatusOr<std::unique_ptr<Reconstructor>> Create(Backend& backend,
                                                               const Capture& capture,
                                                               const ReconstructOptions& options);

  // Goes on from a checkpoint of the same capture and options. DATA_LOSS: it cannot be of them, or
  // Validate refuses it.
  static absl::StatusOr<std::unique_ptr<Reconstructor>> Resume(
      Backend& backend, const Capture& capture, const ReconstructOptions& options,
      const ReconstructCheckpoint& checkpoint);

  // What is left out, in the order in which it was decided; a run that goes on from a checkpoint
  // does not know what was decided before.
  const std::vector<SkippedTerm>& skipped() const { return skipped_; }
  // True after options.num_steps steps, those that are left out counted in.
  bool done() const { return place_ >= options_.num_steps; }
  // The loss and PSNR reported are those of the newest step that the device has finished, which may
  // be some steps back.
  absl::StatusOr<StepReport> Step();
  // Between two steps; waits for the backend, whose error it tells.
  absl::StatusOr<ReconstructCheckpoint> Save();
  Gaussians Result() const { return state_.Download(); }

 private:
  Reconstructor(Backend& backend, const Capture& capture, const ReconstructOptions& options);

  absl::Status Allocated() const;
  absl::Status CheckOurs(const ReconstructCheckpoint& checkpoint) const;
  absl::Status Restore(const ReconstructCheckpoint& checkpoint);
  void TrainOn(const StepInput& input, int64_t entry_room);
  void LearnView(const StepInput& input, int64_t entry_room);
  void Settle();
  double LossOf(const StepResult& result) const;
  double DepthExplained(const StepResult& result) const;
  void LeaveOutWhatIsNotNeeded();
  absl::Status Refine(const StepInput& input);
  float NearPlane() const;
  absl::StatusOr<StepReport> Report() const;

  Backend& backend_;
  const ReconstructOptions options_;
  std::vector<SkippedTerm> skipped_;
  const double scene_radius_;
  std::mt19937_64 random_;
  const std::vector<ScenePoint> points_;
  const Schedule schedule_;
  Refiner refiner_;
  const TrainingViews views_;
  ViewSampler sampler_;
  const LogScaleBounds log_scales_;
  GaussianState state_;
  const Densifier densifier_;
  RenderScratch scratch_;
  Buffer<float> color_, color_grad_;  // [3, H, W] of the largest view
  DepthTerm depth_term_;
  Buffer<double> loss_sums_;  // [kNumLossSums]
  int step_ = 0;              // done
  int place_ = 0;             // in the schedule: done and left out
  EntryRooms entry_rooms_;
  StepResults results_;
  SceneNeeds needs_;
  std::optional<StepResult> newest_;
  int64_t num_culled_degenerate_ = 0, num_skipped_gradients_ = 0, num_void_renders_ = 0;
  int64_t num_skipped_depths_ = 0;
};

}  // namespace pepeseg
