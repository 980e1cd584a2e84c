#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/base/progress.h"
#include "core/features/batch_source.h"
#include "core/features/checkpoint.h"
#include "core/features/feature_optimizer.h"
#include "core/features/options.h"
#include "core/features/preparation.h"

namespace pepeseg {

// Stage two (METHOD.md section 3), a few steps at a time; the twin of GaussianTrainer. Not thread
// safe; it draws batches on threads of its own. The backend and the capture must outlive it.
class FeatureTrainer {
 public:
  using State = FeatureCheckpoint;
  using Product = FeatureField;

  // Prepares the first step. INVALID_ARGUMENT: an option is out of range. FAILED_PRECONDITION: no
  // training view has a mask with a scale.
  static absl::StatusOr<std::unique_ptr<FeatureTrainer>> Create(Backend& backend,
                                                                const Capture& capture,
                                                                const Gaussians& gaussians,
                                                                const FeatureOptions& options);
  // Resumes from a checkpoint of the same capture, Gaussians and options. DATA_LOSS: the checkpoint
  // does not fit them. Other errors as from Create.
  static absl::StatusOr<std::unique_ptr<FeatureTrainer>> Resume(
      Backend& backend, const Capture& capture, const Gaussians& gaussians,
      const FeatureOptions& options, const FeatureCheckpoint& checkpoint);

  // Number of steps done.
  int64_t step() const { return step_; }
  // True when all steps of the schedule have been done or skipped.
  bool done() const { return step_ == num_steps(); }
  // Skipped parts, in the order of the decisions. After Resume, steps skipped before the checkpoint
  // are missing.
  const std::vector<SkippedPart>& skipped() const { return skipped_; }
  // Agreement of the capture's masks across views, see MaskQuality.
  std::optional<double> mask_quality() const { return prepared_.mask_quality; }

  // Does as many steps as the backend queues before the host waits (one if it does not queue), and
  // returns a report of each. Must not be called once done(). INTERNAL: the device failed, or a
  // loss is not finite. RESOURCE_EXHAUSTED: the blend rows do not fit into the device's memory.
  absl::StatusOr<StepReports> Step();
  // Returns the state after the steps done. INTERNAL: the device failed.
  absl::StatusOr<FeatureCheckpoint> Save();
  // Returns the field after the steps done. The training can continue, with other last bits.
  FeatureField Result();
  // Returns the same, and changes nothing of the training.
  FeatureField Snapshot();

 private:
  // initial: see InitialFeatures.
  FeatureTrainer(Backend& backend, PreparedFeatures prepared, std::span<const float> initial,
                 const FeatureOptions& options);
  absl::Status Restore(const FeatureCheckpoint& checkpoint);
  // Returns the reports of the latest steps, which had these losses. INTERNAL: see Step.
  absl::StatusOr<StepReports> Reports(std::span<const double> losses) const;
  // Steps of the schedule without those left out.
  int num_steps() const { return options_.num_steps - left_out_.num; }
  // Returns how many steps to queue before the host waits for their losses.
  int StepsAhead() const;
  // Returns how many of the steps before `end` to do at once.
  int StepsAtOnce(int end) const;
  // Ends the schedule early if the losses have stopped falling.
  void ReviewLosses(std::span<const double> losses);
  void LeaveOut(const LeftOutSteps& steps);

  Backend& backend_;
  const FeatureOptions options_;
  const PreparedFeatures prepared_;
  FeatureOptimizer optimizer_;
  BatchSource batches_;
  std::vector<SkippedPart> skipped_;
  int step_ = 0;
  LeftOutSteps left_out_;
  const int window_;  // steps, see Convergence
  Convergence losses_;
};

}  // namespace pepeseg
