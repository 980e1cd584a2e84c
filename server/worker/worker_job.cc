#include "server/worker/worker_job.h"

#include <google/protobuf/util/json_util.h>
#include <spdlog/spdlog.h>
#include <sys/resource.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "core/base/file_error.h"
#include "core/base/status_macros.h"
#include "core/evaluate/metrics.h"
#include "core/formats/gaussian_ply.h"
#include "core/model_files/model_file.h"
#include "kernels/backend.h"
#include "server/api/convert.h"
#include "server/worker/worker_checkpoints.h"
#include "server/worker/worker_folders.h"
#include "server/worker/worker_inputs.h"
#include "server/worker/worker_scores.h"
#include "server/worker/worker_stage_log.h"
#include "server/worker/worker_stages.h"
#include "server/worker_protocol/device.h"

namespace pepeseg {
namespace {

// What the stages hand on.
class Training {
 public:
  Training(const WorkerJob& job, TrainingSettings settings, HeldOutScorer scorer,
           std::unique_ptr<Backend> backend)
      : job_(job),
        settings_(std::move(settings)),
        scorer_(std::move(scorer)),
        backend_(std::move(backend)),
        stages_(job),
        checkpoints_(job.folder, job.spec, "reconstruct",
                     ReconstructIdentity(job.spec, ToProto(settings_)),
                     [this](const std::string& message) { stages_.Warn(message); }),
        feature_checkpoints_(job.folder, job.spec, "features",
                             FeatureIdentity(job.spec, ToProto(settings_)),
                             [this](const std::string& message) { stages_.Warn(message); }) {}

  absl::Status MakeInputs();
  absl::Status ReconstructScene();
  absl::Status TrainSceneFeatures();
  absl::StatusOr<JobResult> Index();

 private:
  absl::Status Step(const StepReport& report);
  absl::Status TakeGivenGaussians();
  absl::Status TrainGaussians();
  void GoOnFrom(int64_t step, const char* metric);
  absl::StatusOr<Gaussians> ReconstructOrResume();
  std::optional<Gaussians> FindEarlierReconstruction() const;
  absl::Status WriteModelTo(const std::filesystem::path& folder);
  absl::Status ScoreScene();
  absl::Status CheckDevice() const;
  void DescribeModel();
  void TakeMetrics();

  const WorkerJob& job_;
  TrainingSettings settings_;
  HeldOutScorer scorer_;
  std::unique_ptr<Backend> backend_;
  StageLog stages_;
  WorkerCheckpoints checkpoints_, feature_checkpoints_;
  SceneInputs inputs_;
  Model model_;
};

absl::Status Training::CheckDevice() const {
  if (backend_->error().empty()) return absl::OkStatus();
  return absl::InternalError(absl::StrCat("stage ", stages_.stage(), ": ", backend_->error()));
}

absl::Status Training::MakeInputs() {
  ASSIGN_OR_RETURN(inputs_, MakeSceneInputs(job_, settings_, stages_));
  return absl::OkStatus();
}

absl::Status Training::Step(const StepReport& report) {
  RETURN_IF_ERROR(stages_.Step(report));
  // What was promised when the job was admitted.
  if (report.stage == "reconstruct" && report.num_gaussians > settings_.reconstruct.max_gaussians) {
    return absl::InternalError(absl::StrCat("stage ", stages_.stage(), ", step ", report.step, ": ",
                                            report.num_gaussians, " Gaussians, max_gaussians is ",
                                            settings_.reconstruct.max_gaussians));
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
  stages_.GoOnFrom(step);
  model_.metrics[metric] = static_cast<double>(step);
}

absl::StatusOr<Gaussians> Training::ReconstructOrResume() {
  if (std::optional<Gaussians> earlier = FindEarlierReconstruction()) return *std::move(earlier);
  ASSIGN_OR_RETURN(
      const std::unique_ptr<Reconstructor> reconstructor,
      BeginReconstruction(checkpoints_, *backend_, inputs_.capture, settings_.reconstruct));
  GoOnFrom(checkpoints_.first_step(), "resumed_from_step");
  RETURN_IF_ERROR(stages_.TellSkipped(reconstructor->skipped()));
  absl::StatusOr<Gaussians> gaussians = [&] {
    const Polling polling(job_.stop);
    return FinishReconstruction(*reconstructor, [&](const StepReport& report) {
      RETURN_IF_ERROR(stages_.TellSkipped(reconstructor->skipped()));
      return SaveStep(Step(report), report.step, *reconstructor, checkpoints_);
    });
  }();
  RETURN_IF_ERROR(gaussians.status());
  RETURN_IF_ERROR(CheckDevice());
  return gaussians;
}

absl::Status Training::ReconstructScene() {
  RETURN_IF_ERROR(stages_.Start("reconstruct"));
  DescribeModel();
  RETURN_IF_ERROR(inputs_.gaussians ? TakeGivenGaussians() : TrainGaussians());
  return ScoreScene();
}

absl::Status Training::TakeGivenGaussians() {
  ASSIGN_OR_RETURN(
      model_.gaussians,
      ReadGaussianPly(inputs_.gaussians->path, inputs_.gaussians->name, inputs_.capture.origin));
  if (model_.gaussians.count == 0) {
    return absl::InvalidArgumentError(inputs_.gaussians->name + ": has no Gaussians");
  }
  model_.facts["gaussians"] = "given as " + inputs_.gaussians->name;
  v1::JobEvent::StageEnded end;
  end.set_skipped("given");
  return stages_.End({{"num_gaussians", static_cast<double>(model_.gaussians.count)}}, end);
}

absl::Status Training::TrainGaussians() {
  ASSIGN_OR_RETURN(model_.gaussians, ReconstructOrResume());
  const std::filesystem::path folder = job_.folder.reconstruction(job_.spec.fence);
  RETURN_IF_ERROR(WriteModelTo(folder));
  checkpoints_.Remove();
  return stages_.End({{"num_gaussians", static_cast<double>(model_.gaussians.count)}});
}

void Training::TakeMetrics() {
  for (const auto& [name, value] : stages_.metrics()) model_.metrics[name] = value;
}

absl::Status Training::WriteModelTo(const std::filesystem::path& folder) {
  TakeMetrics();
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) return FileError(folder, "create", error.value());
  return WriteModel(folder, model_);
}

absl::Status Training::ScoreScene() {
  RETURN_IF_ERROR(stages_.Start("evaluate"));
  ASSIGN_OR_RETURN(const std::vector<ViewScores> scores,
                   scorer_.Score(*backend_, inputs_.capture, model_.gaussians,
                                 [this](const std::string& message) { stages_.Warn(message); }));
  RETURN_IF_ERROR(CheckDevice());
  return stages_.End(KeepScores(scores, model_), DescribeScores(scores));
}

absl::Status Training::TrainSceneFeatures() {
  if (stages_.metrics().at("num_masks") == 0) {
    spdlog::info("no masks: the model can be rendered, not segmented");
    return absl::OkStatus();
  }
  RETURN_IF_ERROR(stages_.Start("features"));
  ASSIGN_OR_RETURN(const std::unique_ptr<FeatureStage> stage,
                   BeginFeatures(feature_checkpoints_, *backend_, inputs_.capture, model_.gaussians,
                                 settings_.features));
  GoOnFrom(feature_checkpoints_.first_step(), "features_resumed_from_step");
  RETURN_IF_ERROR(stages_.TellSkipped(stage->skipped()));
  absl::StatusOr<FeatureField> field = [&] {
    const Polling polling(job_.stop);
    return FinishFeatures(*stage, [&](const StepReport& report) {
      RETURN_IF_ERROR(stages_.TellSkipped(stage->skipped()));
      return SaveStep(Step(report), stage->step(), *stage, feature_checkpoints_);
    });
  }();
  RETURN_IF_ERROR(field.status());
  RETURN_IF_ERROR(CheckDevice());
  model_.field = *std::move(field);
  std::map<std::string, double> metrics;
  if (stage->mask_quality()) metrics["mask_quality"] = *stage->mask_quality();
  return stages_.End(metrics);
}

void Training::DescribeModel() {
  for (const View& view : inputs_.capture.views) {
    model_.views.push_back({.name = view.name,
                            .camera = view.camera,
                            .cam_from_world = view.cam_from_world,
                            .held_out = view.held_out,
                            .photograph = view.photograph});
  }
  model_.origin = inputs_.capture.origin;
  model_.scene_radius = SceneRadius(inputs_.capture);
  for (const auto& [what, source] : inputs_.sources) model_.facts[what] = source;
  model_.facts["job"] = job_.spec.job;
  model_.facts["device"] = backend_->name();
  model_.facts["version"] = PEPESEG_VERSION;
  std::string options;
  if (google::protobuf::util::MessageToJsonString(ToProto(settings_), &options).ok()) {
    model_.facts["options"] = options;
  }
}

absl::StatusOr<JobResult> Training::Index() {
  RETURN_IF_ERROR(stages_.Start("index"));
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  model_.metrics["peak_device_bytes"] = static_cast<double>(backend_->peak_bytes_in_use());
  model_.metrics["peak_memory_bytes"] = static_cast<double>(usage.ru_maxrss) * 1024;
  const std::filesystem::path folder = job_.folder.attempt(job_.spec.fence);
  RETURN_IF_ERROR(WriteModelTo(folder));
  RemoveIntermediates(job_.folder, job_.spec.fence);
  RETURN_IF_ERROR(stages_.End({}));
  JobResult result;
  TakeMetrics();
  result.metrics = model_.metrics;
  result.sources = inputs_.sources;
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
  RETURN_IF_ERROR(training.MakeInputs());
  RETURN_IF_ERROR(training.ReconstructScene());
  RETURN_IF_ERROR(training.TrainSceneFeatures());
  return training.Index();
}

}  // namespace pepeseg
