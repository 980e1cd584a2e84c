#include "server/services/job_service.h"

#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/train/settings/training_settings.h"
#include "server/api/convert.h"
#include "server/api/error.h"
#include "server/api/records_to_proto.h"
#include "server/api/resource_name.h"
#include "server/services/job_wait.h"
#include "server/services/watch_job.h"

namespace pepeseg {
namespace {

// Reads scene, dataset and options of a request to train, or to estimate a training.
template <class Request>
absl::StatusOr<WantedTraining> WantedFromRequest(const NamedScenes& scenes,
                                                 const Request& request) {
  WantedTraining wanted;
  ASSIGN_OR_RETURN(wanted.scene, scenes.Scene(request.scene(), "scene"));
  ASSIGN_OR_RETURN(const SceneChild dataset,
                   scenes.Child(request.dataset(), "datasets", "dataset"));
  if (dataset.scene != wanted.scene) {
    return BadField("dataset", request.dataset(), absl::StrCat("not of ", request.scene()));
  }
  wanted.dataset = dataset.number;
  ASSIGN_OR_RETURN(wanted.settings, TrainingSettingsFromProto(request.options()));
  return wanted;
}

// Returns the message's bytes, which are the same for the same options in any order.
std::string StableBytes(const v1::TrainingOptions& options) {
  std::string bytes;
  google::protobuf::io::StringOutputStream stream(&bytes);
  google::protobuf::io::CodedOutputStream coded(&stream);
  coded.SetSerializationDeterministic(true);
  options.SerializeToCodedStream(&coded);
  coded.Trim();
  return bytes;
}

// Returns the record of a job to be queued. Checks what depends on the request alone.
absl::StatusOr<JobRecord> JobFromRequest(const v1::TrainSceneRequest& request,
                                         const WantedTraining& wanted) {
  RETURN_IF_ERROR(CheckRequestId(request.request_id()));
  JobRecord job;
  job.scene = wanted.scene;
  job.dataset = wanted.dataset;
  // Both forms are kept: `options`, as the client sent them, recognise a repeated request even
  // after a default has changed; `effective_options` are those the worker runs with.
  job.options = StableBytes(request.options());
  job.effective_options = StableBytes(ToProto(wanted.settings));
  job.request_id = request.request_id();
  job.preview = wanted.settings.preset == Preset::kPreview;
  return job;
}

// Returns FAILED_PRECONDITION if the options ask for a program that the server does not have.
absl::Status CheckPriors(const PriorOptions& priors, bool has_command, bool has_sam) {
  if (AsksForSam(priors.masks) && !has_sam) {
    return absl::FailedPreconditionError(
        "options.priors.masks asks for SAM, and this server has none: its operator installs it by "
        "deploy/sam.sh, or names its folder by pepesegd --sam");
  }
  for (const auto& [name, maker] : {std::pair{"masks", priors.masks}, {"depth", priors.depth}}) {
    if (has_command || maker != PriorMaker::kCommand) continue;
    return absl::FailedPreconditionError(
        absl::StrCat("options.priors.", name,
                     " is PRIOR_MAKER_COMMAND, and this server has no "
                     "priors command: its operator sets it by pepesegd --priors-command"));
  }
  return absl::OkStatus();
}

absl::StatusOr<std::optional<JobState>> StateFromProto(v1::JobState state) {
  switch (state) {
    case v1::JOB_STATE_UNSPECIFIED:
      return std::optional<JobState>();
    case v1::JOB_STATE_QUEUED:
      return JobState::kQueued;
    case v1::JOB_STATE_RUNNING:
      return JobState::kRunning;
    case v1::JOB_STATE_SUCCEEDED:
      return JobState::kSucceeded;
    case v1::JOB_STATE_FAILED:
      return JobState::kFailed;
    case v1::JOB_STATE_CANCELLED:
      return JobState::kCancelled;
    default:
      return BadField("state", absl::StrCat(static_cast<int>(state)), "no state of a job");
  }
}

// Returns INVALID_ARGUMENT, with names like it, for a held-out view that the dataset does not have.
// Frames of videos have no names yet: the training checks them.
absl::Status CheckSplit(const ImportOptions& import, const std::vector<DatasetFileRecord>& files) {
  if (import.held_out_views.empty()) return absl::OkStatus();
  std::vector<std::string> photographs;
  for (const DatasetFileRecord& file : files) {
    if (file.kind == v1::FILE_KIND_VIDEO) return absl::OkStatus();
    if (file.kind == v1::FILE_KIND_IMAGE) photographs.push_back(PhotoKey(file.path));
  }
  const absl::Status checked = CheckHeldOutViews(import, photographs);
  if (checked.ok()) return checked;
  return {checked.code(), absl::StrCat("options.import.", checked.message())};
}

}  // namespace

JobServiceRpc::JobServiceRpc(const CallRunner& runner, const Dependencies& deps)
    : runner_(runner),
      store_(deps.store),
      blobs_(deps.blobs),
      supervisor_(deps.supervisor),
      estimator_(deps.store, deps.blobs, deps.machine) {}

absl::Status JobServiceRpc::CheckSealed(const SceneRef& scene, int64_t dataset) const {
  const std::string name = ChildName(scene, "datasets", dataset);
  const auto record = store_.datasets().GetDataset(scene, dataset);
  if (!record.ok()) return WithResource(record.status(), "NO_SUCH_DATASET", name);
  if (record->state == DatasetState::kSealed) return absl::OkStatus();
  return WithResource(absl::FailedPreconditionError(absl::StrCat(name, " is not sealed")),
                      "NOT_SEALED", name);
}

absl::Status JobServiceRpc::CheckRunnable(const WantedTraining& training) const {
  const EstimateTools& tools = estimator_.tools();
  RETURN_IF_ERROR(CheckPriors(training.settings.priors, tools.has_priors_command, tools.has_sam));
  RETURN_IF_ERROR(CheckSealed(training.scene, training.dataset));
  ASSIGN_OR_RETURN(const std::vector<DatasetFileRecord> files,
                   store_.files().ListDatasetFiles(training.scene, training.dataset));
  RETURN_IF_ERROR(CheckSplit(training.settings.import, files));
  return CheckFilesStored(training.scene, training.dataset, files);
}

absl::Status JobServiceRpc::CheckFilesStored(const SceneRef& scene, int64_t dataset,
                                             const std::vector<DatasetFileRecord>& files) const {
  const std::string& project = scene.project;
  std::vector<std::string> healed, gone;
  const DatasetFileRecord* first = nullptr;
  int num_missing = 0;
  for (const DatasetFileRecord& file : files) {
    // The disk decides, and the records follow: bytes that another upload has brought again heal
    // the file, and bytes that the blob checker has set aside are marked as gone.
    const bool there = blobs_.Has({project, file.sha256}, file.size);
    if (there && !file.stored) healed.push_back(file.sha256);
    if (there) continue;
    if (file.stored) gone.push_back(file.sha256);
    if (++num_missing == 1) first = &file;
  }
  RETURN_IF_ERROR(store_.files().SetDigestsStored(project, healed, /*stored=*/true));
  RETURN_IF_ERROR(store_.files().SetDigestsStored(project, gone, /*stored=*/false));
  if (num_missing == 0) return absl::OkStatus();
  return WithResource(
      absl::FailedPreconditionError(absl::StrCat(
          ChildName(scene, "datasets", dataset), ": the stored bytes of ", num_missing, " of ",
          files.size(), " files are damaged or gone, the first is '", first->path,
          "'; upload the same files again, then train this dataset or the new one")),
      "FILES_MISSING", first->path);
}

absl::Status JobServiceRpc::TrainScene(const UnaryCall& call, const v1::TrainSceneRequest& request,
                                       v1::Job* response) const {
  ASSIGN_OR_RETURN(const WantedTraining training, WantedFromRequest(call.scenes(), request));
  ASSIGN_OR_RETURN(JobRecord wanted, JobFromRequest(request, training));
  wanted.traceparent = TraceparentOf(*call.context);
  RETURN_IF_ERROR(CheckRunnable(training));
  ASSIGN_OR_RETURN(const WorkerShare share,
                   estimator_.CheckFits(training, [&call] { return call.CheckWanted(); }));
  wanted.host_bytes = share.host_bytes;
  wanted.seconds = share.seconds;
  // Everything but the queue has been checked. The answer describes a job that does not exist, so
  // it has neither a state nor a time.
  if (request.validate_only()) {
    *response = ToProto(wanted);
    response->set_state(v1::JOB_STATE_UNSPECIFIED);
    response->clear_create_time();
    return absl::OkStatus();
  }
  // The store's transaction checks what the checks above cannot hold fast: the dataset is sealed,
  // the scene has no active job, and the quota has room.
  const auto job = supervisor_.Submit(wanted);
  // The active job may have ended since; then the error names none, and a retry succeeds.
  if (absl::IsAborted(job.status())) {
    const auto active = store_.jobs().FindActiveJob(wanted.scene);
    const bool found = active.ok() && active->has_value();
    return WithResource(job.status(), "JOB_ACTIVE", found ? JobName((*active)->id) : "");
  }
  RETURN_IF_ERROR(job.status());
  *response = ToProto(*job);
  JobWaits(store_).Fill(*job, *response);
  return absl::OkStatus();
}

absl::Status JobServiceRpc::ListTrainingOptions(const UnaryCall& /*call*/,
                                                const v1::ListTrainingOptionsRequest& request,
                                                v1::ListTrainingOptionsResponse* response) const {
  if (!v1::TrainingPreset_IsValid(request.preset())) {
    return BadField("preset", absl::StrCat(static_cast<int>(request.preset())), "is not a preset");
  }
  v1::TrainingOptions preset;
  if (request.has_preset()) preset.set_preset(request.preset());
  ASSIGN_OR_RETURN(const TrainingSettings settings, TrainingSettingsFromProto(preset));
  for (const OptionText& option : pepeseg::ListOptions(settings)) {
    v1::TrainingOption& added = *response->add_options();
    added.set_name(option.name);
    added.set_default_value(option.value);
    added.set_range(option.range);
    added.set_description(std::string(OptionDescriptions().at(option.name)));
  }
  return absl::OkStatus();
}

absl::Status JobServiceRpc::GetJob(const UnaryCall& /*call*/, const v1::GetJobRequest& request,
                                   v1::Job* response) const {
  ASSIGN_OR_RETURN(const std::string id, ParseJobName(request.name(), "name"));
  auto snapshot = ReadJob(store_, supervisor_, id);
  RETURN_IF_ERROR(snapshot.status());
  *response = std::move(snapshot->job);
  return absl::OkStatus();
}

absl::Status JobServiceRpc::ListJobs(const UnaryCall& call, const v1::ListJobsRequest& request,
                                     v1::ListJobsResponse* response) const {
  JobStore::JobFilter filter;
  filter.project = call.caller.visible_project();
  if (!request.scene().empty()) {
    ASSIGN_OR_RETURN(filter.scene, call.scenes().Scene(request.scene(), "scene"));
  }
  ASSIGN_OR_RETURN(filter.state, StateFromProto(request.state()));
  ASSIGN_OR_RETURN(const PageRequest page,
                   PageFromProto(request.page_size(), request.page_token()));
  ASSIGN_OR_RETURN(const Page<JobRecord> jobs, store_.jobs().ListJobs(filter, page));
  JobWaits waits(store_);
  for (const JobRecord& record : jobs.records) {
    v1::Job* job = response->add_jobs();
    *job = ToProto(record);
    waits.Fill(record, *job);
    // The store has no progress: it comes from the job's event log. A log that cannot be read
    // must not fail the list.
    if (record.state != JobState::kRunning) continue;
    const auto newest = supervisor_.FindNewest(record.id);
    if (newest.ok() && newest->progress.has_value()) *job->mutable_progress() = *newest->progress;
  }
  response->set_next_page_token(jobs.next_page_token);
  return absl::OkStatus();
}

absl::Status JobServiceRpc::CancelJob(const UnaryCall& /*call*/,
                                      const v1::CancelJobRequest& request,
                                      v1::Job* response) const {
  ASSIGN_OR_RETURN(const std::string id, ParseJobName(request.name(), "name"));
  const auto record = supervisor_.Cancel(id);
  if (!record.ok()) return WithResource(record.status(), "NO_SUCH_JOB", request.name());
  *response = ToProto(*record);
  return absl::OkStatus();
}

grpc::ServerWriteReactor<v1::JobEvent>* JobServiceRpc::WatchJob(
    grpc::CallbackServerContext* call, const v1::WatchJobRequest* request) {
  const auto stream = std::make_shared<WatchJobStream>(
      WatchJobStream::Dependencies{runner_, store_, supervisor_}, OriginOf(*call), *request);
  stream->Begin();
  return stream.get();  // owns itself until OnDone
}

absl::Status JobServiceRpc::EstimateTraining(const UnaryCall& call,
                                             const v1::EstimateTrainingRequest& request,
                                             v1::EstimateTrainingResponse* response) const {
  ASSIGN_OR_RETURN(const WantedTraining training, WantedFromRequest(call.scenes(), request));
  RETURN_IF_ERROR(CheckRunnable(training));
  auto estimate = estimator_.Estimate(training, [&call] { return call.CheckWanted(); });
  RETURN_IF_ERROR(estimate.status());
  *response = *std::move(estimate);
  return absl::OkStatus();
}

}  // namespace pepeseg
