#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/base/convergence.h"
#include "core/features/batches_ahead.h"
#include "core/features/centroid_term.h"
#include "core/features/feature_checkpoint.h"
#include "core/features/feature_preparation.h"
#include "core/features/feature_trainer.h"
#include "core/features/row_chunk.h"
#include "core/features/train_features.h"
#include "core/render/frozen_scene.h"

namespace pepeseg {

// Stage two, some steps at a time. Not thread safe.
class FeatureStage {
 public:
  // The backend and the capture must outlive it. INVALID_ARGUMENT: bad options.
  // FAILED_PRECONDITION: no training view has a mask with a scale.
  static absl::StatusOr<std::unique_ptr<FeatureStage>> Create(Backend& backend,
                                                              const Capture& capture,
                                                              const Gaussians& gaussians,
                                                              const FeatureOptions& options);
  // Goes on from a checkpoint of the same capture, Gaussians and options. DATA_LOSS: it does not
  // fit them.
  static absl::StatusOr<std::unique_ptr<FeatureStage>> Resume(Backend& backend,
                                                              const Capture& capture,
                                                              const Gaussians& gaussians,
                                                              const FeatureOptions& options,
                                                              const FeatureCheckpoint& checkpoint);

  int step() const { return step_; }  // done
  // What is left out, in the order in which it was decided; a stage that goes on from a checkpoint
  // does not know what was decided before.
  const std::vector<SkippedTerm>& skipped() const { return skipped_; }
  bool done() const { return step_ == num_steps(); }
  // How far the capture's masks agree across views, see MaskQuality.
  std::optional<double> mask_quality() const { return mask_quality_; }

  // As many steps as are queued before the host waits: one where calls are done when they return.
  // Their reports. INTERNAL: the device failed, or a loss is not finite.
  absl::StatusOr<std::vector<StepReport>> Advance();
  absl::StatusOr<FeatureCheckpoint> Save();
  FeatureField Export();

 private:
  FeatureStage(Backend& backend, const Capture& capture, const Gaussians& gaussians,
               const FeatureOptions& options);
  absl::Status Begin(PreparedFeatures prepared, const FeatureCheckpoint* checkpoint);
  absl::Status Restore(const FeatureCheckpoint& checkpoint);
  absl::Status BeginChunk();
  absl::StatusOr<std::vector<StepReport>> Reports(std::span<const double> losses) const;
  int num_steps() const { return options_.num_steps - num_left_out_; }
  int StepsAhead() const;
  void ReviewLosses(std::span<const double> losses);

  Backend& backend_;
  const Capture& capture_;
  const FeatureOptions options_;
  const int64_t num_gaussians_;
  std::vector<SkippedTerm> skipped_;
  FrozenScene scene_;
  FeatureField field_;
  Buffer<int32_t> neighbors_;
  NeighborGraph graph_;
  std::optional<BatchDrawer> drawer_;
  std::optional<double> mask_quality_;
  std::vector<MaskSet> completed_masks_;  // before what refers to them
  std::unique_ptr<Reprojection> reprojection_;
  std::unique_ptr<CrossView> cross_view_;
  std::unique_ptr<PerceptionCues> cues_;  // null: the perception loss is left out
  std::optional<CentroidTerm> centroids_;
  std::optional<FeatureTrainer> trainer_;
  std::optional<BatchesAhead> batches_;  // its threads draw: gone before the drawer
  DrawerState chunk_start_;
  RowChunk chunk_;
  int step_ = 0;
  int steps_of_chunk_ = 0;
  int num_left_out_ = 0, left_out_after_ = 0;  // steps of the schedule; of these done
  int window_ = 1;                             // steps; see Convergence
  Convergence losses_;
};

// The steps that are left. An error of `progress`, called after each step, ends it.
absl::StatusOr<FeatureField> FinishFeatures(FeatureStage& stage, ProgressFn progress);

}  // namespace pepeseg
