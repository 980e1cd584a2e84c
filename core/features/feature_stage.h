#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/base/progress.h"
#include "core/features/batch_chunks.h"
#include "core/features/centroid_term.h"
#include "core/features/feature_checkpoint.h"
#include "core/features/feature_preparation.h"
#include "core/features/feature_trainer.h"
#include "core/features/options.h"
#include "core/render/renderer.h"

namespace pepeseg {

// Stage two as a whole (METHOD.md section 3), a few steps at a time, so that a caller can report
// progress, save checkpoints and stop in between. Not thread safe; it draws batches on threads of
// its own.
class FeatureStage {
 public:
  // Prepares the first step. The backend and the capture must outlive the stage. INVALID_ARGUMENT:
  // an option is out of range. FAILED_PRECONDITION: no training view has a mask with a scale.
  static absl::StatusOr<std::unique_ptr<FeatureStage>> Create(Backend& backend,
                                                              const Capture& capture,
                                                              const Gaussians& gaussians,
                                                              const FeatureOptions& options);
  // Resumes from a checkpoint of the same capture, Gaussians and options. DATA_LOSS: the checkpoint
  // does not fit them. Other errors as from Create.
  static absl::StatusOr<std::unique_ptr<FeatureStage>> Resume(Backend& backend,
                                                              const Capture& capture,
                                                              const Gaussians& gaussians,
                                                              const FeatureOptions& options,
                                                              const FeatureCheckpoint& checkpoint);

  // Returns the number of steps done.
  int step() const { return step_; }
  // Returns the parts that are left out, in the order in which that was decided. After Resume,
  // steps that were left out before the checkpoint are not listed.
  const std::vector<SkippedPart>& skipped() const { return skipped_; }
  // Returns whether all steps are done.
  bool done() const { return step_ == num_steps(); }
  // Returns how well the capture's masks agree across views, see MaskQuality.
  std::optional<double> mask_quality() const { return mask_quality_; }

  // Does as many steps as the backend queues before the host waits (one if it does not queue), and
  // returns a report of each. Must not be called once done(). INTERNAL: the device failed, or a
  // loss is not finite. RESOURCE_EXHAUSTED: the blend rows do not fit into the device's memory.
  absl::StatusOr<std::vector<StepReport>> Advance();
  // Returns the state after the steps done. INTERNAL: the device failed.
  absl::StatusOr<FeatureCheckpoint> Save();
  // Returns the field after the steps done. The stage can continue.
  FeatureField Export();

 private:
  FeatureStage(Backend& backend, const Capture& capture, const Gaussians& gaussians,
               const FeatureOptions& options);
  // Builds the members from what is prepared, and restores the checkpoint unless it is null.
  absl::Status Begin(PreparedFeatures prepared, const FeatureCheckpoint* checkpoint);
  absl::Status Restore(const FeatureCheckpoint& checkpoint);
  // Takes the next chunk of batches and rasterises its views.
  absl::Status BeginChunk();
  // Returns the reports of the latest steps, which had these losses. INTERNAL: see Advance.
  absl::StatusOr<std::vector<StepReport>> Reports(std::span<const double> losses) const;
  // Steps of the schedule without those left out.
  int num_steps() const { return options_.num_steps - num_left_out_; }
  // Returns how many steps to queue before the host waits for their losses.
  int StepsAhead() const;
  // Ends the schedule early if the losses have stopped falling.
  void ReviewLosses(std::span<const double> losses);

  Backend& backend_;
  const Capture& capture_;
  const FeatureOptions options_;
  const int64_t num_gaussians_;
  std::vector<SkippedPart> skipped_;
  Renderer scene_;
  FeatureField field_;  // scale_quantiles and confidence; the rest is in the trainer
  Buffer<int32_t> neighbors_;
  NeighborGraph graph_;
  std::optional<BatchDrawer> drawer_;
  std::optional<double> mask_quality_;
  std::vector<MaskSet> completed_masks_;  // declared before the drawer, which refers to them
  std::unique_ptr<Reprojection> reprojection_;
  std::unique_ptr<CrossView> cross_view_;
  std::unique_ptr<PerceptionCues> cues_;  // null: no perception loss
  std::optional<CentroidTerm> centroids_;
  std::optional<FeatureTrainer> trainer_;
  std::optional<BatchesAhead> batches_;  // destroyed before the drawer, which its threads use
  DrawerState chunk_start_;              // of the drawer before the current chunk
  RowChunk chunk_;
  int step_ = 0;
  int steps_of_chunk_ = 0;                     // steps done of the current chunk
  int num_left_out_ = 0, left_out_after_ = 0;  // see FeatureCheckpoint::Counters
  int window_ = 1;                             // steps, see Convergence
  Convergence losses_;
};

// Does the remaining steps and returns the field. Calls `progress` for each step; an error that it
// returns ends the stage with that error.
absl::StatusOr<FeatureField> FinishFeatures(FeatureStage& stage, ProgressFn progress);

}  // namespace pepeseg
