#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "core/train/training_observer.h"
#include "core/train/training_settings.h"
#include "server/worker/worker_checkpoints.h"
#include "server/worker/worker_job.h"
#include "server/worker/worker_progress.h"

namespace pepeseg {

// Follows the training of a job: writes its events, the worker's log, and the checkpoints in the
// job's folder. `job.stop` cancels the training.
class JobObserver final : public TrainingObserver {
 public:
  // `job` must outlive it. `settings`: the settings in effect.
  JobObserver(const WorkerJob& job, const TrainingSettings& settings);

  // Returns the SHA-256 of each file whose stored bytes are damaged or missing.
  const std::vector<std::string>& damaged_files() const { return damaged_files_; }

  void PlanStages(std::vector<PlannedStage> stages) override;
  absl::Status StartStage(const std::string& stage) override;
  void ResumeStage(int64_t step) override;
  absl::Status Step(const StepReport& report) override;
  absl::Status SkipPart(const SkippedTerm& skipped) override;
  absl::Status EndStage(const StageEnd& end) override;
  void Warn(const std::string& message) override;
  void Log(const std::string& message) override;
  void MadeMasks(const std::string& source) override;
  void ReportDamagedFile(const std::string& sha256) override;
  bool IsCancelled() const override { return stop_.stop; }
  void SetPolling(bool polling) override { stop_.polled = polling; }
  StageCheckpoints* checkpoints(const std::string& stage) override;

 private:
  StopSwitch& stop_;
  WorkerProgress progress_;
  std::string stage_;
  WorkerCheckpoints reconstruct_checkpoints_, feature_checkpoints_;
  std::vector<std::string> damaged_files_;
};

}  // namespace pepeseg
