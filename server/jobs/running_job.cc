#include "server/jobs/running_job.h"

#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "core/status_macros.h"
#include "server/jobs/file_error.h"

namespace pepeseg {
namespace {

// Of the worker's log, in an error message: those stay under 4 KB.
constexpr size_t kLogTail = 1500;

v1::JobState ToProto(JobState state) {
  // The two enums count alike, the proto's from 1.
  return static_cast<v1::JobState>(static_cast<int>(state) + 1);
}
static_assert(v1::JOB_STATE_QUEUED == static_cast<int>(JobState::kQueued) + 1);
static_assert(v1::JOB_STATE_CANCELLED == static_cast<int>(JobState::kCancelled) + 1);

// A limit of the worker broke, or the kernel ran out of memory: asking for less may help.
absl::StatusCode CodeOf(const WorkerProcess::End& end) {
  const bool limit = end.signal == SIGXCPU || end.signal == SIGXFSZ;
  return limit ? absl::StatusCode::kResourceExhausted : absl::StatusCode::kInternal;
}

}  // namespace

absl::Status AppendState(const JobFolder& folder, const JobRow& job) {
  std::error_code error;
  std::filesystem::create_directories(folder.path(), error);
  if (error) return FileError(folder.path(), "create", error.value());
  ASSIGN_OR_RETURN(const std::unique_ptr<EventLogWriter> log,
                   EventLogWriter::Open(folder.events()));
  v1::JobEvent event;
  v1::JobEvent::StateChanged& change = *event.mutable_state_changed();
  change.set_state(ToProto(job.state));
  if (job.state == JobState::kFailed) {
    change.mutable_error()->set_code(job.error_code);
    change.mutable_error()->set_message(job.error_message);
  }
  if (job.model != 0) change.set_model(absl::StrCat("scenes/", job.scene, "/models/", job.model));
  return log->Append(std::move(event));
}

RunningJob::RunningJob(const Context& context, JobRow job, JobFolder folder)
    : context_(context), job_(std::move(job)), folder_(std::move(folder)), log_(folder_.events()) {}

absl::StatusOr<std::unique_ptr<RunningJob>> RunningJob::Start(const Context& context,
                                                              const JobRow& job) {
  const JobFolder folder(context.options.data_folder / "jobs" / job.id);
  auto running = std::unique_ptr<RunningJob>(new RunningJob(context, job, folder));
  RETURN_IF_ERROR(AppendState(folder, job));
  running->FollowLog();
  RETURN_IF_ERROR(running->WriteSpec());
  std::vector<std::string> arguments = {absl::StrCat("--job=", folder.path().string()),
                                        absl::StrCat("--parent=", getpid()),
                                        absl::StrCat("--colmap=", context.options.colmap),
                                        absl::StrCat("--log-format=", context.options.log_format)};
  if (const std::filesystem::path& weights = context.options.lpips_weights; !weights.empty()) {
    arguments.push_back(absl::StrCat("--lpips-weights=", weights.string()));
  }
  if (const std::filesystem::path& command = context.options.priors_command; !command.empty()) {
    arguments.push_back(absl::StrCat("--priors-command=", command.string()));
    arguments.push_back(absl::StrCat("--priors-seconds=", context.options.priors_seconds));
  }
  ASSIGN_OR_RETURN(running->process_,
                   WorkerProcess::Launch({context.options.worker, arguments, folder.worker_log()}));
  spdlog::info("jobs/{}: attempt {} runs as process {}", job.id, job.fence,
               running->process_->pid());
  return running;
}

absl::Status RunningJob::WriteSpec() const {
  JobSpec spec;
  spec.job = job_.id;
  spec.fence = job_.fence;
  spec.device = context_.options.device;
  spec.num_threads = context_.options.num_threads;
  spec.memory_limit = context_.options.memory_limit;
  spec.traceparent = job_.traceparent;
  if (!spec.options.ParseFromString(job_.effective_options)) {
    return absl::DataLossError("the job's stored options are no training options");
  }
  ASSIGN_OR_RETURN(const std::vector<DatasetFileRow> files,
                   context_.store.ListDatasetFiles(job_.scene, job_.dataset));
  for (const DatasetFileRow& file : files) {
    spec.files.push_back(
        {file.path, file.kind, context_.options.file_path(file).string(), file.sha256});
  }
  return folder_.WriteSpec(spec);
}

bool RunningJob::FollowLog() {
  const absl::StatusOr<std::vector<v1::JobEvent>> events = log_.Read();
  if (!events.ok() || events->empty()) return false;
  for (const v1::JobEvent& event : *events) {
    sequence_ = event.sequence();
    if (event.has_progress()) progress_ = event.progress();
    if (event.has_stage_started()) stage_ = event.stage_started().stage();
    // What stands there before the worker is launched is of earlier attempts.
    if (process_ != nullptr && context_.options.on_event) context_.options.on_event(job_.id, event);
  }
  if (stage_ == job_.stage) return true;
  const absl::Status noted = context_.store.SetJobStage(job_.id, job_.fence, stage_);
  if (noted.ok()) job_.stage = stage_;
  return true;
}

void RunningJob::Terminate(absl::Duration grace) {
  const absl::Time now = absl::Now();
  kill_at_ = std::min(kill_at_, now + grace);
  if (!terminated_) process_->Signal(SIGTERM);
  terminated_ = true;
  if (now >= kill_at_) process_->Signal(SIGKILL);
}

std::string RunningJob::DescribeCrash(const WorkerProcess::End& end) const {
  std::string text = absl::StrCat("the worker ", Describe(end));
  if (stage_.empty()) {
    absl::StrAppend(&text, " before its first stage");
  } else {
    absl::StrAppend(&text, " in stage '", stage_, "'");
  }
  if (progress_ && progress_->stage() == stage_) {
    absl::StrAppend(&text, " at step ", progress_->step(), " of ", progress_->num_steps());
  }
  if (end.signal == SIGKILL) {
    absl::StrAppend(&text, "; nobody here did it: an operator, or the kernel out of memory");
  }
  const std::string tail = ReadFileTail(folder_.worker_log(), kLogTail);
  if (!tail.empty()) absl::StrAppend(&text, "; its log ends with: ", tail);
  return text;
}

absl::Status RunningJob::Outcome(JobResult* result) {
  const WorkerProcess::End end = *process_->Poll();
  const bool told = end.signal == 0 && end.exit_code != static_cast<int>(WorkerExit::kBadSpec);
  const absl::StatusOr<JobResult> read = folder_.ReadResult(job_.fence);
  if (told && read.ok() && read->status.ok() == (end.exit_code == 0)) {
    *result = *read;
    return read->status;
  }
  if (terminated_) return absl::CancelledError("the worker was stopped");
  return absl::Status(CodeOf(end), DescribeCrash(end));
}

absl::Status RunningJob::CommitModel(const JobResult& result) {
  ModelRow model;
  model.folder =
      absl::StrCat("jobs/", job_.id, "/", folder_.attempt(job_.fence).filename().string());
  model.metrics = MetricsToJson(result.metrics);
  model.sources = SourcesToJson(result.sources);
  model.num_gaussians = result.num_gaussians;
  model.num_bytes = result.num_bytes;
  ASSIGN_OR_RETURN(model, context_.store.CommitModel(job_.id, job_.fence, model));
  spdlog::info("jobs/{}: made scenes/{}/models/{}", job_.id, job_.scene, model.number);
  return absl::OkStatus();
}

absl::Status RunningJob::Finish(bool requeue) {
  FollowLog();
  JobResult result;
  const absl::Status outcome = Outcome(&result);
  if (outcome.ok()) {
    RETURN_IF_ERROR(CommitModel(result));
    ASSIGN_OR_RETURN(job_, context_.store.GetJob(job_.id));
  } else if (requeue && absl::IsCancelled(outcome)) {
    ASSIGN_OR_RETURN(job_, context_.store.RequeueJob(job_.id, job_.fence));
  } else {
    ASSIGN_OR_RETURN(job_, context_.store.EndJob(job_.id, job_.fence, outcome));
  }
  if (job_.state != JobState::kSucceeded) {
    spdlog::warn("jobs/{}: attempt {} ended: {}", job_.id, job_.fence, outcome.ToString());
  }
  if (job_.state == JobState::kFailed || job_.state == JobState::kCancelled) {
    std::error_code ignored;  // what is left is collected with the job
    std::filesystem::remove_all(folder_.attempt(job_.fence), ignored);
    std::filesystem::remove_all(folder_.priors(), ignored);
  }
  absl::Status told = AppendState(folder_, job_);
  FollowLog();
  return told;
}

}  // namespace pepeseg
