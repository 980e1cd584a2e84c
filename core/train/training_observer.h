#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "core/base/progress.h"
#include "core/evaluate/image_scores.h"
#include "core/model_files/checkpoint.h"
#include "core/scene/model.h"
#include "core/train/settings/stage_plan.h"
#include "core/train/training_inputs.h"
#include "core/train/training_metrics.h"

namespace pepeseg {

// Stores checkpoints of one stage, so that a later run resumes from them.
class StageCheckpoints {
 public:
  // Writes the state of a step to `path`, as a file with that header.
  using WriteState =
      absl::FunctionRef<absl::Status(const std::filesystem::path&, const CheckpointHeader&)>;

  virtual ~StageCheckpoints() = default;

  // Offers the checkpoints of this run and of earlier ones, the farthest first, until `use` returns
  // OK for one. When it does for none, the stage starts at step 0.
  virtual void Resume(absl::FunctionRef<absl::Status(const Checkpoint& file)> use) = 0;
  // Returns the step that the stage resumed from. 0: it started from the beginning.
  virtual int64_t first_step() const = 0;
  // Called after each step; writes a checkpoint when one is due.
  virtual void SaveIfDue(int64_t step, WriteState write) = 0;
  // Writes a checkpoint now.
  virtual void Save(int64_t step, WriteState write) = 0;
  // Removes all checkpoints of the stage, of this run and of earlier ones.
  virtual void Remove() const = 0;
};

// A picture of the scene as stage one trains it.
struct Preview {
  int64_t step = 0, num_steps = 0;  // steps of the stage done, and their number
  std::string view = {};            // name of the view that is shown
  int width = 0, height = 0;        // pixels, at most kMaxPreviewSide each
  std::string jpeg = {};            // at most kMaxPreviewBytes
};
inline constexpr int kMaxPreviewSide = 640;
inline constexpr size_t kMaxPreviewBytes = 30'000;

// The field as stage two trains it.
struct FieldSnapshot {
  int64_t step = 0, num_steps = 0;  // steps of the stage done, and their number
  FeatureField field = {};
};
inline constexpr double kMaxSnapshotCost = 0.02;  // share of the stage's time, see PreviewSchedule

// How a stage ended.
struct StageEnd {
  Stage stage = Stage::kPrepare;
  TrainingMetrics metrics = {};        // of the stage's result, and its times
  std::string skipped = {};            // why it did not run, such as "given"; empty: it ran
  std::vector<ViewScores> views = {};  // scores of the held-out views; stage "evaluate" only
};

// Receives the reports of a training, provides its checkpoints, and can cancel it. Every method but
// IsCancelled is called on the thread of Train. An error that a method returns ends the training
// with that error. The defaults ignore everything and never cancel.
class TrainingObserver {
 public:
  virtual ~TrainingObserver() = default;

  // Receives the stages that are expected to run, for an ETA. Called again when more is known.
  virtual void PlanStages(std::vector<PlannedStage>) {}
  virtual absl::Status StartStage(Stage) { return absl::OkStatus(); }
  // The stage starts after the `step` steps that an earlier run has done.
  virtual void ResumeStage(int64_t /*step*/) {}
  virtual absl::Status Step(const StepReport&) { return absl::OkStatus(); }
  virtual absl::Status SkipPart(const SkippedPart&) { return absl::OkStatus(); }
  // Returns true if stage one is to render previews for ShowPreview.
  virtual bool WantsPreviews() const { return false; }
  virtual absl::Status ShowPreview(const Preview&) { return absl::OkStatus(); }
  // Returns the time from stage two's first step to the first call of KeepSnapshot,
  // seconds; further ones follow as PreviewSchedule says. Absent: none. The Gaussians are then
  // below the run's folder as a model, in kReconstructFolder or kGivenFolder. If it is there, stage
  // one may write a model with a field to kEarlyFolder, see EarlyField.
  virtual std::optional<double> FirstSnapshotSeconds() const { return std::nullopt; }
  virtual absl::Status KeepSnapshot(FieldSnapshot) { return absl::OkStatus(); }
  virtual absl::Status EndStage(const StageEnd&) { return absl::OkStatus(); }

  // Receive a sentence for the owner of the training, or for the operator of the machine.
  virtual void Warn(const std::string& /*message*/) {}
  virtual void Log(const std::string& /*message*/) {}
  // Reports that stage "priors" has made masks without the operator's command.
  virtual void MadeMasks(const Source&) {}
  // Receives the declared SHA-256 of a file whose bytes are damaged or gone.
  virtual void ReportDamagedFile(const std::string& /*sha256*/) {}

  // Returns true if the training is to end with CANCELLED. May be called on any thread.
  virtual bool IsCancelled() const { return false; }
  // While `polling` is true, the training calls IsCancelled at least several times a second and
  // saves its state when it is cancelled. Otherwise there is nothing to save: the process may end
  // at any instruction.
  virtual void SetPolling(bool /*polling*/) {}

  // Returns the checkpoints of kReconstruct or kFeatures, owned by the observer. Null: none are
  // kept.
  virtual StageCheckpoints* checkpoints(Stage) { return nullptr; }
};

// Sets polling while it is in scope.
class Polling {
 public:
  explicit Polling(TrainingObserver& observer) : observer_(observer) { observer_.SetPolling(true); }
  ~Polling() { observer_.SetPolling(false); }
  Polling(const Polling&) = delete;
  Polling& operator=(const Polling&) = delete;

 private:
  TrainingObserver& observer_;
};

}  // namespace pepeseg
