#include "server/worker/job_observer.h"

#include <spdlog/spdlog.h>

#include <utility>

#include "server/api/convert.h"
#include "server/api/mask_advice.h"

namespace pepeseg {

// Checkpoints of a stage are for its own options only, so that a change of stage two's options does
// not discard those of stage one.
JobObserver::JobObserver(const WorkerJob& job, const TrainingSettings& settings)
    : stop_(job.stop),
      progress_(job.log),
      reconstruct_checkpoints_(job.folder, job.spec, "reconstruct",
                               ReconstructIdentity(job.spec, ToProto(settings)),
                               [this](const std::string& message) { Warn(message); }),
      feature_checkpoints_(job.folder, job.spec, "features",
                           FeatureIdentity(job.spec, ToProto(settings)),
                           [this](const std::string& message) { Warn(message); }) {}

void JobObserver::PlanStages(std::vector<PlannedStage> stages) {
  progress_.Plan(std::move(stages));
}

absl::Status JobObserver::StartStage(const std::string& stage) {
  stage_ = stage;
  spdlog::info("stage {} begins", stage);
  return progress_.StartStage(stage);
}

void JobObserver::ResumeStage(int64_t step) { progress_.ResumeAt(step); }

absl::Status JobObserver::Step(const StepReport& report) { return progress_.Step(report); }

absl::Status JobObserver::SkipPart(const SkippedTerm& skipped) {
  spdlog::info("stage {}, step {}: {} skipped: {} ({} steps saved)", stage_, skipped.step,
               skipped.term, skipped.reason, skipped.saved_steps);
  return progress_.SkipPart(skipped);
}

// Logs how the stage ended, and writes the event.
absl::Status JobObserver::EndStage(const StageEnd& end) {
  v1::JobEvent::StageEnded event;
  event.set_skipped(end.skipped);
  for (const ViewScores& view : end.views) {
    spdlog::info("{}: PSNR {:.2f} dB, SSIM {:.4f}", view.view, view.scores.psnr, view.scores.ssim);
    v1::JobEvent::ViewScores& scores = *event.add_views();
    scores.set_view(view.view);
    *scores.mutable_scores() = ToProto(view.scores);
  }
  if (!end.skipped.empty()) spdlog::info("stage {} skipped: {}", stage_, end.skipped);
  if (const auto seconds = end.metrics.find("seconds_" + stage_); seconds != end.metrics.end()) {
    spdlog::info("stage {} took {:.2f} s", stage_, seconds->second);
  }
  return progress_.EndStage(end.metrics, std::move(event));
}

void JobObserver::Warn(const std::string& message) {
  spdlog::warn("{}", message);
  progress_.Warn(message).IgnoreError();  // the worker's log has it anyway
}

void JobObserver::Log(const std::string& message) { spdlog::info("{}", message); }

// Warns if the masks of that source may be poor, and says how to get better ones.
void JobObserver::MadeMasks(const std::string& source) {
  for (const std::string& advice : AdviceOnModel({{"masks", source}})) Warn(advice);
}

void JobObserver::ReportDamagedFile(const std::string& sha256) { damaged_files_.push_back(sha256); }

StageCheckpoints* JobObserver::checkpoints(const std::string& stage) {
  if (stage == "reconstruct") return &reconstruct_checkpoints_;
  return stage == "features" ? &feature_checkpoints_ : nullptr;
}

}  // namespace pepeseg
