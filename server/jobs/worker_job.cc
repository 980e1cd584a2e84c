#include "server/jobs/worker_job.h"

#include <google/protobuf/util/json_util.h>
#include <spdlog/spdlog.h>
#include <sys/resource.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "core/evaluate/metrics.h"
#include "core/io/gaussian_ply.h"
#include "core/io/import.h"
#include "core/io/model_file.h"
#include "core/status_macros.h"
#include "kernels/backend.h"
#include "server/convert.h"
#include "server/device.h"
#include "server/jobs/file_error.h"
#include "server/jobs/worker_checkpoints.h"
#include "server/jobs/worker_folders.h"
#include "server/jobs/worker_progress.h"
#include "server/jobs/worker_scores.h"
#include "server/jobs/worker_stages.h"

namespace pepeseg {
namespace {

// More would drown the log; the rest is counted.
constexpr size_t kMaxWarnings = 100;

// What the stages hand on.
class Training {
 public:
  Training(const WorkerJob& job, TrainingSettings settings, HeldOutScorer scorer,
           std::unique_ptr<Backend> backend)
      : job_(job),
        settings_(std::move(settings)),
        scorer_(std::move(scorer)),
        backend_(std::move(backend)),
        progress_(job.log),
        checkpoints_(job.folder, job.spec, "reconstruct",
                     ReconstructIdentity(job.spec, ToProto(settings_)),
                     [this](const std::string& message) { Warn(message); }),
        feature_checkpoints_(job.folder, job.spec, "features",
                             FeatureIdentity(job.spec, ToProto(settings_)),
                             [this](const std::string& message) { Warn(message); }) {}

  absl::Status Prepare();
  absl::Status ReconstructScene();
  absl::Status TrainSceneFeatures();
  absl::StatusOr<JobResult> Index();

 private:
  absl::StatusOr<std::vector<DatasetFile>> Files() const;
  absl::Status Step(const StepReport& report);
  void Warn(const std::string& message);
  absl::Status TellSkipped(const std::vector<SkippedTerm>& skipped);
  absl::Status TakeGivenGaussians();
  absl::Status TrainGaussians();
  void GoOnFrom(int64_t step, const char* metric);
  absl::StatusOr<Gaussians> ReconstructOrResume();
  std::optional<Gaussians> FindEarlierReconstruction() const;
  absl::Status WriteModelTo(const std::filesystem::path& folder) const;
  absl::Status ScoreScene();
  absl::Status CheckDevice() const;
  absl::Status StartStage(const std::string& stage);
  absl::Status EndStage(std::map<std::string, double> metrics, v1::JobEvent::StageEnded end = {});
  void DescribeModel();

  const WorkerJob& job_;
  TrainingSettings settings_;
  HeldOutScorer scorer_;
  std::unique_ptr<Backend> backend_;
  WorkerProgress progress_;
  WorkerCheckpoints checkpoints_, feature_checkpoints_;
  std::string stage_;
  Capture capture_;
  std::optional<DatasetFile> given_gaussians_;
  Model model_;
};

absl::Status Training::StartStage(const std::string& stage) {
  stage_ = stage;
  if (job_.stop.stop) return absl::CancelledError("stopped before stage " + stage);
  spdlog::info("stage {} begins", stage);
  return progress_.StartStage(stage);
}

absl::Status Training::EndStage(std::map<std::string, double> metrics,
                                v1::JobEvent::StageEnded end) {
  const double seconds = progress_.seconds_in_stage();
  spdlog::info("stage {} took {:.2f} s", stage_, seconds);
  metrics["seconds_" + stage_] = seconds;
  for (const auto& [name, value] : metrics) model_.metrics[name] = value;
  return progress_.EndStage(metrics, std::move(end));
}

absl::Status Training::CheckDevice() const {
  if (backend_->error().empty()) return absl::OkStatus();
  return absl::InternalError(absl::StrCat("stage ", stage_, ": ", backend_->error()));
}

absl::StatusOr<std::vector<DatasetFile>> Training::Files() const {
  std::vector<DatasetFile> files;
  for (const JobSpecFile& file : job_.spec.files) {
    ASSIGN_OR_RETURN(const FileKind kind, FileKindFromProto(static_cast<v1::FileKind>(file.kind)));
    files.push_back({kind, file.name, file.path});
  }
  return files;
}

absl::Status Training::Prepare() {
  RETURN_IF_ERROR(StartStage("prepare"));
  ASSIGN_OR_RETURN(const std::vector<DatasetFile> files, Files());
  ASSIGN_OR_RETURN(capture_, ImportCapture(files, settings_.import));
  for (const DatasetFile& file : files) {
    if (file.kind == FileKind::kGaussians) given_gaussians_ = file;
  }
  for (size_t i = 0; i < capture_.warnings.size() && i < kMaxWarnings; ++i) {
    Warn(capture_.warnings[i]);
  }
  if (capture_.warnings.size() > kMaxWarnings) {
    Warn(absl::StrCat("and ", capture_.warnings.size() - kMaxWarnings, " more warnings"));
  }
  double num_masks = 0, num_depth_maps = 0;
  for (const View& view : capture_.views) {
    num_masks += view.masks.num_masks;
    num_depth_maps += view.depth.values.empty() ? 0 : 1;
  }
  return EndStage({{"num_views", static_cast<double>(capture_.views.size())},
                   {"num_points", static_cast<double>(capture_.points.size())},
                   {"num_masks", num_masks},
                   {"num_depth_maps", num_depth_maps}});
}

absl::Status Training::Step(const StepReport& report) {
  if (job_.stop.stop) {
    return absl::CancelledError(absl::StrCat("stopped in stage ", stage_, " at step ", report.step,
                                             " of ", report.num_steps));
  }
  // What was promised when the job was admitted.
  if (report.stage == "reconstruct" && report.num_gaussians > settings_.reconstruct.max_gaussians) {
    return absl::InternalError(absl::StrCat("stage ", stage_, ", step ", report.step, ": ",
                                            report.num_gaussians, " Gaussians, max_gaussians is ",
                                            settings_.reconstruct.max_gaussians));
  }
  return progress_.Step(report);
}

void Training::Warn(const std::string& message) {
  spdlog::warn("{}", message);
  progress_.Warn(message).IgnoreError();  // it is in the worker's log
}

absl::Status Training::TellSkipped(const std::vector<SkippedTerm>& skipped) {
  for (const SkippedTerm& term : skipped) {
    spdlog::info("stage {}: {} skipped: {}", stage_, term.term, term.reason);
    RETURN_IF_ERROR(progress_.SkipTerm(term));
  }
  return absl::OkStatus();
}

// An earlier attempt of this job may have got so far: same files, options and seed, so the same
// Gaussians.
std::optional<Gaussians> Training::FindEarlierReconstruction() const {
  for (int64_t fence = job_.spec.fence - 1; fence > 0; --fence) {
    absl::StatusOr<Model> earlier = ReadModel(job_.folder.reconstruction(fence));
    if (!earlier.ok()) continue;
    spdlog::info("stage one was done by attempt {}", fence);
    return std::move(earlier->gaussians);
  }
  return std::nullopt;
}

void Training::GoOnFrom(int64_t step, const char* metric) {
  if (step == 0) return;
  progress_.GoOnFrom(step);
  model_.metrics[metric] = static_cast<double>(step);
}

absl::StatusOr<Gaussians> Training::ReconstructOrResume() {
  if (std::optional<Gaussians> earlier = FindEarlierReconstruction()) return *std::move(earlier);
  ASSIGN_OR_RETURN(const std::unique_ptr<Reconstructor> reconstructor,
                   BeginReconstruction(checkpoints_, *backend_, capture_, settings_.reconstruct));
  GoOnFrom(checkpoints_.first_step(), "resumed_from_step");
  RETURN_IF_ERROR(TellSkipped(reconstructor->skipped()));
  job_.stop.polled = true;
  absl::StatusOr<Gaussians> gaussians =
      FinishReconstruction(*reconstructor, [&](const StepReport& report) {
        return SaveStep(Step(report), report.step, *reconstructor, checkpoints_);
      });
  job_.stop.polled = false;
  RETURN_IF_ERROR(gaussians.status());
  RETURN_IF_ERROR(CheckDevice());
  return gaussians;
}

absl::Status Training::ReconstructScene() {
  RETURN_IF_ERROR(StartStage("reconstruct"));
  DescribeModel();
  RETURN_IF_ERROR(given_gaussians_ ? TakeGivenGaussians() : TrainGaussians());
  return ScoreScene();
}

absl::Status Training::TakeGivenGaussians() {
  ASSIGN_OR_RETURN(model_.gaussians,
                   ReadGaussianPly(given_gaussians_->path, given_gaussians_->name));
  if (model_.gaussians.count == 0) {
    return absl::InvalidArgumentError(given_gaussians_->name + ": has no Gaussians");
  }
  model_.facts["gaussians"] = "given as " + given_gaussians_->name;
  v1::JobEvent::StageEnded end;
  end.set_skipped("given");
  return EndStage({{"num_gaussians", static_cast<double>(model_.gaussians.count)}}, end);
}

absl::Status Training::TrainGaussians() {
  ASSIGN_OR_RETURN(model_.gaussians, ReconstructOrResume());
  const std::filesystem::path folder = job_.folder.reconstruction(job_.spec.fence);
  RETURN_IF_ERROR(WriteModelTo(folder));
  checkpoints_.Remove();
  return EndStage({{"num_gaussians", static_cast<double>(model_.gaussians.count)}});
}

absl::Status Training::WriteModelTo(const std::filesystem::path& folder) const {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) return FileError(folder, "create", error.value());
  return WriteModel(folder, model_);
}

absl::Status Training::ScoreScene() {
  RETURN_IF_ERROR(StartStage("evaluate"));
  ASSIGN_OR_RETURN(const std::vector<ViewScores> scores,
                   scorer_.Score(*backend_, capture_, model_.gaussians,
                                 [this](const std::string& message) { Warn(message); }));
  RETURN_IF_ERROR(CheckDevice());
  return EndStage(KeepScores(scores, model_), DescribeScores(scores));
}

absl::Status Training::TrainSceneFeatures() {
  if (model_.metrics["num_masks"] == 0) {
    spdlog::info("no masks: the model can be rendered, not segmented");
    return absl::OkStatus();
  }
  RETURN_IF_ERROR(StartStage("features"));
  ASSIGN_OR_RETURN(const std::unique_ptr<FeatureStage> stage,
                   BeginFeatures(feature_checkpoints_, *backend_, capture_, model_.gaussians,
                                 settings_.features));
  GoOnFrom(feature_checkpoints_.first_step(), "features_resumed_from_step");
  RETURN_IF_ERROR(TellSkipped(stage->skipped()));
  job_.stop.polled = true;
  absl::StatusOr<FeatureField> field = FinishFeatures(*stage, [&](const StepReport& report) {
    return SaveStep(Step(report), stage->step(), *stage, feature_checkpoints_);
  });
  job_.stop.polled = false;
  RETURN_IF_ERROR(field.status());
  RETURN_IF_ERROR(CheckDevice());
  model_.field = *std::move(field);
  return EndStage({});
}

void Training::DescribeModel() {
  for (const View& view : capture_.views) {
    model_.views.push_back({view.name, view.camera, view.cam_from_world, view.held_out});
  }
  model_.scene_radius = SceneRadius(capture_);
  model_.facts["job"] = job_.spec.job;
  model_.facts["device"] = backend_->name();
  model_.facts["version"] = PEPESEG_VERSION;
  std::string options;
  if (google::protobuf::util::MessageToJsonString(ToProto(settings_), &options).ok()) {
    model_.facts["options"] = options;
  }
}

absl::StatusOr<JobResult> Training::Index() {
  RETURN_IF_ERROR(StartStage("index"));
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  model_.metrics["peak_device_bytes"] = static_cast<double>(backend_->peak_bytes_in_use());
  model_.metrics["peak_memory_bytes"] = static_cast<double>(usage.ru_maxrss) * 1024;
  const std::filesystem::path folder = job_.folder.attempt(job_.spec.fence);
  RETURN_IF_ERROR(WriteModelTo(folder));
  RemoveIntermediates(job_.folder, job_.spec.fence);
  RETURN_IF_ERROR(EndStage({}));
  JobResult result;
  result.metrics = model_.metrics;
  result.num_gaussians = model_.gaussians.count;
  ASSIGN_OR_RETURN(result.num_bytes, BytesIn(folder));
  return result;
}

}  // namespace

absl::StatusOr<JobResult> RunWorkerJob(const WorkerJob& job) {
  ASSIGN_OR_RETURN(TrainingSettings settings, TrainingSettingsFromProto(job.spec.options));
  ASSIGN_OR_RETURN(HeldOutScorer scorer, HeldOutScorer::Create(job.lpips_weights));
  ASSIGN_OR_RETURN(Device device, OpenDevice(job.spec.device, job.spec.num_threads));
  spdlog::info("computing on {}", device.backend->name());
  Training training(job, std::move(settings), std::move(scorer), std::move(device.backend));
  RETURN_IF_ERROR(training.Prepare());
  RETURN_IF_ERROR(training.ReconstructScene());
  RETURN_IF_ERROR(training.TrainSceneFeatures());
  return training.Index();
}

}  // namespace pepeseg
