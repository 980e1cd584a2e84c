#include "server/worker/worker_job.h"

#include <google/protobuf/util/json_util.h>
#include <spdlog/spdlog.h>

#include <filesystem>
#include <future>
#include <optional>
#include <set>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "core/base/status_macros.h"
#include "server/api/convert.h"
#include "server/api/mask_advice.h"
#include "server/worker/sandbox/worker_limits.h"
#include "server/worker/worker_checkpoints.h"
#include "server/worker/worker_progress.h"
#include "server/worker_protocol/device.h"
#include "server/worker_protocol/snapshot_file.h"

namespace pepeseg {
namespace {

constexpr double kFirstSnapshotSeconds = 1;

// Follows the training of a job: writes its events, the worker's log, and the checkpoints in the
// job's folder. `job.stop` cancels the training.
class JobObserver final : public TrainingObserver {
 public:
  // `job` must outlive it. `settings`: the settings in effect.
  JobObserver(const WorkerJob& job, const TrainingSettings& settings);

  // Returns the SHA-256 of each file whose stored bytes are damaged or missing.
  const std::vector<std::string>& damaged_files() const { return damaged_files_; }

  void PlanStages(std::vector<PlannedStage> stages) override;
  absl::Status StartStage(Stage stage) override;
  void ResumeStage(int64_t step) override;
  absl::Status Step(const StepReport& report) override;
  absl::Status SkipPart(const SkippedPart& skipped) override;
  bool WantsPreviews() const override { return true; }
  absl::Status ShowPreview(const Preview& preview) override;
  std::optional<double> FirstSnapshotSeconds() const override { return kFirstSnapshotSeconds; }
  absl::Status KeepSnapshot(FieldSnapshot snapshot) override;
  absl::Status EndStage(const StageEnd& end) override;
  void Warn(const std::string& message) override;
  void Log(const std::string& message) override;
  void MadeMasks(const Source& source) override;
  void ReportDamagedFile(const std::string& sha256) override;
  bool IsCancelled() const override { return stop_.stop; }
  void SetPolling(bool polling) override { stop_.polled = polling; }
  StageCheckpoints* checkpoints(Stage stage) override;

 private:
  const JobFolder& folder_;
  const JobSpec& spec_;
  StopSwitch& stop_;
  WorkerProgress progress_;
  const char* stage_ = "";  // name of the running stage
  WorkerCheckpoints reconstruct_checkpoints_, feature_checkpoints_;
  std::vector<std::string> damaged_files_;
  std::future<void> snapshot_written_;  // waits when it is destroyed
};

// Checkpoints of a stage are for its own options only, so that a change of stage two's options does
// not discard those of stage one.
JobObserver::JobObserver(const WorkerJob& job, const TrainingSettings& settings)
    : folder_(job.folder),
      spec_(job.spec),
      stop_(job.stop),
      progress_(job.log),
      reconstruct_checkpoints_(job.folder, job.spec, Stage::kReconstruct,
                               ReconstructIdentity(job.spec, settings),
                               [this](const std::string& message) { Warn(message); }),
      feature_checkpoints_(job.folder, job.spec, Stage::kFeatures,
                           FeatureIdentity(job.spec, settings),
                           [this](const std::string& message) { Warn(message); }) {}

void JobObserver::PlanStages(std::vector<PlannedStage> stages) {
  progress_.Plan(std::move(stages));
}

absl::Status JobObserver::StartStage(Stage stage) {
  stage_ = NameOf(stage);
  spdlog::info("stage {} begins", stage_);
  return progress_.StartStage(stage);
}

void JobObserver::ResumeStage(int64_t step) { progress_.ResumeAt(step); }

absl::Status JobObserver::Step(const StepReport& report) { return progress_.Step(report); }

absl::Status JobObserver::SkipPart(const SkippedPart& skipped) {
  spdlog::info("stage {}, step {}: {} skipped: {} ({} steps saved)", stage_, skipped.step,
               NameOf(skipped.part), skipped.reason, skipped.saved_steps);
  return progress_.SkipPart(skipped);
}

absl::Status JobObserver::ShowPreview(const Preview& preview) {
  return progress_.ShowPreview(preview);
}

// The training goes on while the file is written. An error costs the snapshot only.
absl::Status JobObserver::KeepSnapshot(FieldSnapshot snapshot) {
  if (snapshot_written_.valid()) snapshot_written_.wait();
  SnapshotFile file = {spec_.job, spec_.fence, snapshot.step, snapshot.num_steps,
                       std::move(snapshot.field)};
  snapshot_written_ = std::async(
      std::launch::async, [path = folder_.snapshot(spec_.fence), file = std::move(file)] {
        const absl::Status written = WriteSnapshotFile(path, file);
        if (written.ok()) return;
        spdlog::warn("no snapshot of step {}: {}", file.step, written.ToString());
      });
  return absl::OkStatus();
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
  if (const auto seconds = end.metrics.seconds[static_cast<size_t>(end.stage)]) {
    spdlog::info("stage {} took {:.2f} s", stage_, *seconds);
  }
  return progress_.EndStage(end.metrics, std::move(event));
}

void JobObserver::Warn(const std::string& message) {
  spdlog::warn("{}", message);
  progress_.Warn(message).IgnoreError();  // the worker's log has it anyway
}

void JobObserver::Log(const std::string& message) { spdlog::info("{}", message); }

// Warns if the masks of that source may be poor, and says how to get better ones.
void JobObserver::MadeMasks(const Source& source) {
  for (const std::string& advice : AdviceOnModel({{"masks", TextOf(source)}})) Warn(advice);
}

void JobObserver::ReportDamagedFile(const std::string& sha256) { damaged_files_.push_back(sha256); }

StageCheckpoints* JobObserver::checkpoints(Stage stage) {
  if (stage == Stage::kReconstruct) return &reconstruct_checkpoints_;
  return stage == Stage::kFeatures ? &feature_checkpoints_ : nullptr;
}

// Returns the folders of this attempt and, as those of earlier runs, of all attempts with a lower
// fence, the newest first.
TrainingFolders FoldersOf(const JobFolder& folder, int64_t fence) {
  TrainingFolders folders;
  folders.run = folder.attempt(fence);
  // Attempts that left nothing have no folder; the stages skip those.
  while (--fence > 0) folders.earlier.push_back(folder.attempt(fence));
  folders.priors = folder.priors();
  folders.sfm_log = folder.sfm_log();
  return folders;
}

TrainingTools ToolsOf(const JobSpec& spec) {
  TrainingTools tools;
  tools.colmap = spec.worker.colmap;
  tools.priors_command = {spec.worker.priors_command, absl::Seconds(spec.worker.priors_seconds)};
  tools.sam = spec.worker.sam;
  tools.sam_cuda_device = CudaDevice(spec.device);
  tools.keep_embeddings = spec.worker.keep_embeddings;
  tools.lpips_weights = spec.worker.lpips_weights;
  tools.num_threads = spec.num_threads;
  tools.memory_limit = MemoryLimit();
  return tools;
}

// Returns metadata of the model that the pipeline does not know: job, version, options.
std::map<std::string, std::string> FactsOf(const JobSpec& spec, const TrainingSettings& settings) {
  std::map<std::string, std::string> facts = {{"job", spec.job}, {"version", PEPESEG_VERSION}};
  std::string options;
  if (google::protobuf::util::MessageToJsonString(ToProto(settings), &options).ok()) {
    facts["options"] = options;
  }
  return facts;
}

JobResult ResultOf(TrainedModel trained, int64_t num_bytes) {
  JobResult result;
  result.metrics = std::move(trained.model.metrics);
  result.sources = ByName(trained.sources);
  result.num_gaussians = trained.model.gaussians.count;
  result.num_bytes = num_bytes;
  return result;
}

absl::StatusOr<JobResult> TrainJob(const WorkerJob& job, const TrainingSettings& settings,
                                   JobObserver& observer) {
  ASSIGN_OR_RETURN(TrainingInputs inputs, TrainingInputsOf(job.folder, job.spec));
  inputs.facts = FactsOf(job.spec, settings);
  ASSIGN_OR_RETURN(const Device device, OpenDevice(job.spec.device, job.spec.num_threads));
  spdlog::info("computing on {}", device.backend->name());
  ASSIGN_OR_RETURN(TrainedModel trained, Train(inputs, settings, *device.backend, observer));
  // A model's folder must not have folders in it, not even empty ones (JobFolder::TakeModel).
  std::error_code ignored;
  std::filesystem::remove_all(job.folder.checkpoints(job.spec.fence), ignored);
  ASSIGN_OR_RETURN(const int64_t num_bytes, BytesIn(inputs.folders.run));
  return ResultOf(std::move(trained), num_bytes);
}

JobResult Failure(const absl::Status& status) {
  JobResult result;
  result.status = status;
  return result;
}

}  // namespace

absl::StatusOr<TrainingInputs> TrainingInputsOf(const JobFolder& folder, const JobSpec& spec) {
  TrainingInputs inputs;
  std::vector<std::string> names;
  for (const JobSpecFile& file : spec.files) names.push_back(file.name);
  const std::set<std::string> extra = ExtraFiles(names);
  for (const JobSpecFile& file : spec.files) {
    if (extra.contains(file.name)) continue;
    ASSIGN_OR_RETURN(const FileKind kind, FileKindFromProto(static_cast<v1::FileKind>(file.kind)));
    inputs.files.push_back({kind, file.name, file.path});
    inputs.sha256.push_back(file.sha256);
  }
  inputs.folders = FoldersOf(folder, spec.fence);
  inputs.tools = ToolsOf(spec);
  return inputs;
}

JobResult RunWorkerJob(const WorkerJob& job) {
  const absl::StatusOr<TrainingSettings> settings = TrainingSettingsFromProto(job.spec.options);
  if (!settings.ok()) return Failure(settings.status());
  JobObserver observer(job, *settings);
  absl::StatusOr<JobResult> result = TrainJob(job, *settings, observer);
  if (result.ok()) return *std::move(result);
  JobResult failure = Failure(result.status());
  // The server checks these files itself before it sets any aside.
  failure.damaged = observer.damaged_files();
  return failure;
}

}  // namespace pepeseg
