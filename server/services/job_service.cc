#include "server/services/job_service.h"

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/api/convert.h"
#include "server/api/resource_name.h"
#include "server/api/rows_to_proto.h"
#include "server/rpc/unary.h"
#include "server/services/estimate_training.h"
#include "server/services/stored_files.h"
#include "server/services/watch_job.h"

namespace pepeseg {
namespace {

// Of a request to train, or to estimate one: scene, dataset and options.
template <class Request>
absl::StatusOr<WantedTraining> WantedFromRequest(const Request& request) {
  WantedTraining wanted;
  ASSIGN_OR_RETURN(wanted.scene, ParseSceneName(request.scene(), "scene"));
  ASSIGN_OR_RETURN(const SceneChild dataset,
                   ParseChildName(request.dataset(), "datasets", "dataset"));
  if (dataset.scene != wanted.scene) {
    return BadField("dataset", request.dataset(), absl::StrCat("not of ", request.scene()));
  }
  wanted.dataset = dataset.number;
  ASSIGN_OR_RETURN(wanted.settings, TrainingSettingsFromProto(request.options()));
  return wanted;
}

// A row to be queued: everything of the request that can be wrong, but for what changes under it.
absl::StatusOr<JobRow> JobFromRequest(const v1::TrainSceneRequest& request,
                                      const WantedTraining& wanted) {
  RETURN_IF_ERROR(CheckRequestId(request.request_id()));
  JobRow job;
  job.scene = wanted.scene;
  job.dataset = wanted.dataset;
  job.options = request.options().SerializeAsString();
  job.effective_options = ToProto(wanted.settings).SerializeAsString();
  job.request_id = request.request_id();
  return job;
}

// What only a program can do that the server was not given.
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

}  // namespace

absl::Status JobServiceRpc::CheckSealed(const std::string& scene, int64_t dataset) const {
  const std::string name = ChildName(scene, "datasets", dataset);
  const auto row = context_.store->datasets().GetDataset(scene, dataset);
  if (!row.ok()) return WithResource(row.status(), "NO_SUCH_DATASET", name);
  if (row->state == DatasetState::kSealed) return absl::OkStatus();
  return WithResource(absl::FailedPreconditionError(absl::StrCat(name, " is not sealed")),
                      "NOT_SEALED", name);
}

absl::Status JobServiceRpc::Train(const v1::TrainSceneRequest& request, const UnaryRequest& call,
                                  v1::Job* response) const {
  ASSIGN_OR_RETURN(const WantedTraining training, WantedFromRequest(request));
  ASSIGN_OR_RETURN(JobRow wanted, JobFromRequest(request, training));
  wanted.traceparent = TraceparentOf(*call.context);
  RETURN_IF_ERROR(
      CheckPriors(training.settings.priors, context_.has_priors_command, context_.has_sam));
  RETURN_IF_ERROR(CheckSealed(training.scene, training.dataset));
  RETURN_IF_ERROR(CheckFilesStored(context_, training.scene, training.dataset));
  ASSIGN_OR_RETURN(const WorkerShare share,
                   CheckFits(context_, training, [&call] { return call.CheckWanted(); }));
  wanted.host_bytes = share.host_bytes;
  wanted.seconds = share.seconds;
  if (request.validate_only()) {
    *response = ToProto(wanted);
    response->set_state(v1::JOB_STATE_UNSPECIFIED);
    response->clear_create_time();
    return absl::OkStatus();
  }
  const auto job = context_.supervisor->Submit(wanted);
  if (absl::IsAborted(job.status())) {
    const auto active = context_.store->jobs().FindActiveJob(wanted.scene);
    const bool found = active.ok() && active->has_value();
    return WithResource(job.status(), "JOB_ACTIVE", found ? JobName((*active)->id) : "");
  }
  RETURN_IF_ERROR(job.status());
  *response = ToProto(*job);
  return absl::OkStatus();
}

grpc::ServerUnaryReactor* JobServiceRpc::TrainScene(grpc::CallbackServerContext* call,
                                                    const v1::TrainSceneRequest* request,
                                                    v1::Job* response) {
  return RunOnPool({call, request}, context_, [this, request, response](const UnaryCall& unary) {
    return Train(*request, unary, response);
  });
}

grpc::ServerUnaryReactor* JobServiceRpc::GetJob(grpc::CallbackServerContext* call,
                                                const v1::GetJobRequest* request,
                                                v1::Job* response) {
  return RunOnPool({call, request}, context_, [this, request, response](const UnaryCall&) {
    ASSIGN_OR_RETURN(const std::string id, ParseJobName(request->name(), "name"));
    auto snapshot = ReadJob(context_, id);
    RETURN_IF_ERROR(snapshot.status());
    *response = std::move(snapshot->job);
    return absl::OkStatus();
  });
}

grpc::ServerUnaryReactor* JobServiceRpc::ListJobs(grpc::CallbackServerContext* call,
                                                  const v1::ListJobsRequest* request,
                                                  v1::ListJobsResponse* response) {
  return RunOnPool({call, request}, context_, [this, request, response](const UnaryCall& unary) {
    JobStore::JobFilter filter;
    filter.project = unary.caller.visible_project();
    if (!request->scene().empty()) {
      ASSIGN_OR_RETURN(filter.scene, ParseSceneName(request->scene(), "scene"));
    }
    ASSIGN_OR_RETURN(filter.state, StateFromProto(request->state()));
    ASSIGN_OR_RETURN(const PageRequest page,
                     PageFromProto(request->page_size(), request->page_token()));
    ASSIGN_OR_RETURN(const Page<JobRow> jobs, context_.store->jobs().ListJobs(filter, page));
    for (const JobRow& row : jobs.rows) {
      v1::Job* job = response->add_jobs();
      *job = ToProto(row);
      if (row.state != JobState::kRunning) continue;
      const auto newest = context_.supervisor->FindNewest(row.id);
      if (newest.ok() && newest->progress.has_value()) *job->mutable_progress() = *newest->progress;
    }
    response->set_next_page_token(jobs.next_page_token);
    return absl::OkStatus();
  });
}

grpc::ServerUnaryReactor* JobServiceRpc::CancelJob(grpc::CallbackServerContext* call,
                                                   const v1::CancelJobRequest* request,
                                                   v1::Job* response) {
  return RunOnPool({call, request}, context_, [this, request, response](const UnaryCall&) {
    ASSIGN_OR_RETURN(const std::string id, ParseJobName(request->name(), "name"));
    const auto row = context_.supervisor->Cancel(id);
    if (!row.ok()) return WithResource(row.status(), "NO_SUCH_JOB", request->name());
    *response = ToProto(*row);
    return absl::OkStatus();
  });
}

grpc::ServerWriteReactor<v1::JobEvent>* JobServiceRpc::WatchJob(
    grpc::CallbackServerContext* call, const v1::WatchJobRequest* request) {
  const auto stream = std::make_shared<WatchJobStream>(context_, OriginOf(*call), *request);
  stream->Begin();
  return stream.get();  // owns itself until OnDone
}

grpc::ServerUnaryReactor* JobServiceRpc::EstimateTraining(
    grpc::CallbackServerContext* call, const v1::EstimateTrainingRequest* request,
    v1::EstimateTrainingResponse* response) {
  return RunOnPool({call, request}, context_, [this, request, response](const UnaryCall& unary) {
    ASSIGN_OR_RETURN(const WantedTraining training, WantedFromRequest(*request));
    RETURN_IF_ERROR(
        CheckPriors(training.settings.priors, context_.has_priors_command, context_.has_sam));
    RETURN_IF_ERROR(CheckSealed(training.scene, training.dataset));
    RETURN_IF_ERROR(CheckFilesStored(context_, training.scene, training.dataset));
    auto estimate =
        pepeseg::EstimateTraining(context_, training, [&unary] { return unary.CheckWanted(); });
    RETURN_IF_ERROR(estimate.status());
    *response = *std::move(estimate);
    return absl::OkStatus();
  });
}

}  // namespace pepeseg
