#include "server/jobs/running_job.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <set>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "core/base/file_io.h"
#include "core/base/status_macros.h"
#include "server/jobs/job_events.h"
#include "server/jobs/launcher.h"
#include "server/jobs/supervisor.h"
#include "server/store/layout.h"
#include "server/worker_protocol/client_text.h"
#include "server/worker_protocol/job_stage.h"

namespace pepeseg {
namespace {

// Bytes of the worker's log that go into an error message, which stays under 4 KB.
constexpr size_t kLogTail = 1500;
// A job fails when its worker has crashed in this many attempts in a row that made no progress.
constexpr int kMaxCrashes = 3;

// Whether the worker exceeded its limit of CPU time or file size. A smaller job may stay below it,
// but another attempt of the same job does not.
bool BrokeLimit(const WorkerEnd& end) { return end.signal == SIGXCPU || end.signal == SIGXFSZ; }

// Whether the server itself lacks disk space or descriptors. That is not the job's fault: its end
// is written later.
bool IsShortage(const absl::Status& status) {
  return absl::IsResourceExhausted(status) || absl::IsUnavailable(status);
}

}  // namespace

RunningJob::RunningJob(const Dependencies& deps, JobRecord job, size_t device)
    : deps_(deps),
      job_(std::move(job)),
      device_(device),
      folder_(JobsFolder(deps.options.data_folder) / job_.id),
      log_(folder_.events()),
      heartbeat_(folder_.heartbeat(job_.fence)) {}

absl::StatusOr<std::unique_ptr<RunningJob>> RunningJob::Start(const Dependencies& deps,
                                                              const JobRecord& job, size_t device) {
  auto running = std::unique_ptr<RunningJob>(new RunningJob(deps, job, device));
  const JobFolder& folder = running->folder_;
  // WriteSpec reads the database, so it comes first: if it fails, no event has been written.
  RETURN_IF_ERROR(running->WriteSpec());
  RETURN_IF_ERROR(AppendState(folder, job));
  running->FollowLog();
  // Stage and progress of earlier attempts do not count.
  running->stage_.clear();
  running->progress_.reset();
  Touch(folder.lease(job.fence));
  // The time for the first heartbeat starts now. The lease file is there before the worker looks at
  // it.
  running->heartbeat_.Expect();
  ASSIGN_OR_RETURN(running->worker_, deps.launcher.Launch(running->Command()));
  // From here on another server can follow the worker. A server that is killed between the launch
  // and this record leaves a cluster job that nobody follows.
  if (const std::string launch = running->worker_->launch(); !launch.empty()) {
    running->job_.launch = launch;
    const absl::Status recorded = deps.store.queue().SetJobLaunch(job.id, job.fence, launch);
    if (!recorded.ok()) {
      // Nobody could follow it, and the next attempt to start would launch a second one.
      running->worker_->Kill();
      return recorded;
    }
  }
  running->follows_live_ = true;
  spdlog::info("jobs/{}: attempt {} is launched on {}", job.id, job.fence,
               deps.options.devices[device].id);
  return running;
}

absl::StatusOr<std::unique_ptr<RunningJob>> RunningJob::Adopt(const Dependencies& deps,
                                                              const JobRecord& job, size_t device) {
  auto running = std::unique_ptr<RunningJob>(new RunningJob(deps, job, device));
  // The folder, the spec and the RUNNING event are those of the holder before.
  ASSIGN_OR_RETURN(running->worker_, deps.launcher.Attach(job.launch));
  running->FollowLog();
  running->follows_live_ = true;
  Touch(running->folder_.lease(job.fence));
  spdlog::info("jobs/{}: attempt {} goes on as {}", job.id, job.fence, job.launch);
  return running;
}

absl::Status RunningJob::WriteSpec() const {
  JobSpec spec;
  spec.job = job_.id;
  spec.fence = job_.fence;
  spec.device = deps_.options.devices[device_].id;
  spec.num_threads = deps_.options.devices[device_].num_threads;
  spec.memory_limit = deps_.options.memory_limit;
  spec.checkpoint_seconds = deps_.options.launch.checkpoint_seconds;
  spec.traceparent = job_.traceparent;
  spec.worker = deps_.options.workers;
  // A worker on a cluster outlives this server: the next holder follows it.
  const bool ends_with_holder = deps_.options.launch.launcher == LaunchOptions::Launcher::kProcess;
  const absl::Duration lease = deps_.store.holder().lease;
  if (ends_with_holder && lease != absl::InfiniteDuration()) {
    spec.lease_seconds = absl::ToInt64Seconds(lease);
  }
  if (!spec.options.ParseFromString(job_.effective_options)) {
    return absl::DataLossError("the job's stored options are not training options");
  }
  ASSIGN_OR_RETURN(const std::vector<DatasetFileRecord> files,
                   deps_.store.files().ListDatasetFiles(job_.scene, job_.dataset));
  const std::string& project = job_.scene.project;
  for (const DatasetFileRecord& file : files) {
    spec.files.push_back(
        {file.path, file.kind, deps_.options.file_path(project, file).string(), file.sha256});
  }
  RETURN_IF_ERROR(folder_.Make());
  return folder_.WriteSpec(spec);
}

WorkerCommand RunningJob::Command() const {
  const SupervisorOptions& options = deps_.options;
  WorkerCommand command;
  command.job = job_.id;
  command.program = options.worker;
  command.log = folder_.worker_log();
  command.needs = {options.devices[device_].num_threads, job_.host_bytes, job_.seconds};
  command.pass_environment = options.workers.pass_environment;
  command.arguments = {absl::StrCat("--job=", folder_.path().string()),
                       absl::StrCat("--fence=", job_.fence)};
  return command;
}

bool RunningJob::FollowLog() {
  const absl::StatusOr<std::vector<v1::JobEvent>> events = log_.Read();
  if (!events.ok() || events->empty()) return false;
  for (const v1::JobEvent& event : *events) {
    sequence_ = event.sequence();
    if (event.has_progress()) progress_ = event.progress();
    if (event.has_stage_started()) stage_ = NameOfStage(event.stage_started().stage());
    // Events that were in the log when this server began to follow are not reported: metrics would
    // count them twice.
    if (follows_live_ && deps_.options.on_event) deps_.options.on_event(job_.id, event);
  }
  // The store has the stage for listings only, so an error is ignored: the next event tries again.
  if (stage_ == job_.stage || worker_ == nullptr) return true;
  const absl::Status recorded = deps_.store.queue().SetJobStage(job_.id, job_.fence, stage_);
  if (recorded.ok()) job_.stage = stage_;
  return true;
}

void RunningJob::RenewLease(const JobRecord& record) {
  if (record.fence != job_.fence) {
    spdlog::info("jobs/{}: {} was started again, as attempt {}", job_.id, job_.launch,
                 record.fence);
    // Slurm has restarted the worker, which took the fence itself (JobQueue::TakeNextFence).
    heartbeat_ = HeartbeatWatch(folder_.heartbeat(record.fence));
  }
  job_ = record;
  Touch(folder_.lease(job_.fence));
}

absl::Duration RunningJob::HeartbeatTimeout() const {
  return absl::Seconds(deps_.options.launch.lease_seconds);
}

void RunningJob::KillIfTimedOut() {
  // On a cluster, Slurm watches the workers.
  if (timed_out_ || check_started_ || !worker_->launch().empty()) return;
  if (absl::FromChrono(heartbeat_.SinceChange()) < HeartbeatTimeout()) return;
  spdlog::warn("jobs/{}: attempt {} gave no sign for {}: killed", job_.id, job_.fence,
               absl::FormatDuration(HeartbeatTimeout()));
  timed_out_ = true;
  worker_->Kill();
}

void RunningJob::Terminate(absl::Duration grace) {
  const absl::Time now = absl::Now();
  kill_at_ = std::min(kill_at_, now + grace);
  // The worker saves a checkpoint, if its stage has any, and ends. Later calls only bring its kill
  // nearer.
  if (!terminated_) worker_->Stop();
  terminated_ = true;
  if (now >= kill_at_) worker_->Kill();
}

bool RunningJob::MayBePutBack() const {
  if (job_.preview || terminated_ || !worker_->launch().empty()) return false;
  constexpr int kMostDoublings = 20;
  const absl::Duration least = absl::Seconds(deps_.options.launch.checkpoint_seconds) *
                               (int64_t{1} << std::min(job_.put_backs, kMostDoublings));
  return absl::Now() - job_.start_time >= least && folder_.HasSaved(job_.fence);
}

void RunningJob::PutBack(absl::Duration grace) {
  put_back_ = true;
  Terminate(grace);
}

void RunningJob::Abandon() {
  spdlog::warn("jobs/{}: attempt {} is no longer this server's", job_.id, job_.fence);
  // A worker on a cluster continues: the new holder follows it.
  if (worker_->launch().empty()) worker_->Kill();
}

std::string RunningJob::DescribeCrash(const WorkerEnd& end) const {
  std::string text = absl::StrCat("the worker ", end.description);
  if (stage_.empty()) {
    absl::StrAppend(&text, " before its first stage");
  } else {
    absl::StrAppend(&text, " in stage '", stage_, "'");
  }
  if (progress_ && NameOfStage(progress_->stage()) == stage_) {
    absl::StrAppend(&text, " at step ", progress_->step(), " of ", progress_->num_steps());
  }
  if (timed_out_) {
    absl::StrAppend(&text, ", because it gave no heartbeat for ",
                    absl::FormatDuration(HeartbeatTimeout()));
  } else if (end.signal == SIGKILL) {
    absl::StrAppend(
        &text, "; the server did not kill it: an operator did, or the kernel for lack of memory");
  }
  // The log may have paths and bytes of strangers: ClientText makes it fit for clients.
  const std::string tail = ReadFileTail(folder_.worker_log(), kLogTail);
  if (!tail.empty()) absl::StrAppend(&text, "; its log ends with: ", tail);
  return ClientText(text);
}

bool RunningJob::Ended() {
  // The end of a job waits for the check of its damaged files, which takes as long as reading them.
  // The loop does not: it asks again.
  if (!worker_->Poll().has_value()) return false;
  if (!check_started_) {
    check_started_ = true;
    const absl::Status started = StartCheck();
    if (!started.ok()) spdlog::error("jobs/{}: damaged files: {}", job_.id, started.ToString());
  }
  return !num_damaged_.valid() ||
         num_damaged_.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
}

// Starts the check of the files that the worker reports as damaged. A worker decodes files from
// strangers, so its report is not trusted: the server reads those of the job's files again before
// it sets any aside.
absl::Status RunningJob::StartCheck() {
  const absl::StatusOr<JobResult> result = folder_.ReadResult(job_.fence);
  if (!result.ok() || !absl::IsDataLoss(result->status) || result->damaged.empty()) {
    return absl::OkStatus();
  }
  if (!deps_.options.check_files) return absl::OkStatus();
  ASSIGN_OR_RETURN(std::vector<DatasetFileRecord> files,
                   deps_.store.files().ListDatasetFiles(job_.scene, job_.dataset));
  const std::string& project = job_.scene.project;
  const std::set<std::string> named(result->damaged.begin(), result->damaged.end());
  std::erase_if(files, [&](const DatasetFileRecord& file) { return !named.contains(file.sha256); });
  num_damaged_ = deps_.options.check_files(project, std::move(files));
  return absl::OkStatus();
}

absl::Status RunningJob::OutcomeOfCheck(const JobResult& result) const {
  // No check, or at least one file is damaged indeed.
  if (!num_damaged_.valid() || num_damaged_.get() > 0) return result.status;
  return absl::InternalError(
      "the worker read other bytes than were uploaded, but the stored files are whole: train "
      "again");
}

// A result counts only if it agrees with the exit code. A worker that ended in another way, or that
// wrote no result, has crashed.
absl::Status RunningJob::ReadOutcome(JobResult* result, absl::Status* outcome) {
  const WorkerEnd end = *worker_->Poll();
  const bool has_result = end.kind == WorkerEnd::Kind::kUnknown ||
                          (end.kind == WorkerEnd::Kind::kExited &&
                           end.exit_code != static_cast<int>(WorkerExit::kBadSpec));
  const absl::StatusOr<JobResult> read = folder_.ReadResult(job_.fence);
  // The result may be there, but this server cannot read it now.
  if (IsShortage(read.status())) return read.status();
  if (has_result && read.ok() &&
      (end.kind == WorkerEnd::Kind::kUnknown || read->status.ok() == (end.exit_code == 0))) {
    *result = *read;
    // A signal that this server has not sent, such as one of the machine's operator, does not
    // cancel the job.
    if (absl::IsCancelled(result->status) && !terminated_) {
      crashed_ = true;
      *outcome = absl::InternalError("the worker was stopped by a signal from outside");
      return absl::OkStatus();
    }
    if (!result->status.ok()) {
      *outcome = OutcomeOfCheck(*result);
      return absl::OkStatus();
    }
    *outcome = TakeModel(*result);
    return IsShortage(*outcome) ? *outcome : absl::OkStatus();
  }
  // A stopped worker leaves no result if it was killed after its grace, or if its stage had nothing
  // to save.
  if (terminated_) {
    *outcome = absl::CancelledError("the worker was stopped");
    return absl::OkStatus();
  }
  lease_lost_ = end.kind == WorkerEnd::Kind::kExited &&
                end.exit_code == static_cast<int>(WorkerExit::kLeaseLost);
  crashed_ = !BrokeLimit(end);
  *outcome = absl::Status(
      BrokeLimit(end) ? absl::StatusCode::kResourceExhausted : absl::StatusCode::kInternal,
      DescribeCrash(end));
  return absl::OkStatus();
}

absl::Status RunningJob::TakeModel(JobResult& result) const {
  // Moves the model out of the folder that the worker may write to. The server measures it itself:
  // quotas do not trust the worker's number.
  ASSIGN_OR_RETURN(result.num_bytes, folder_.TakeModel(job_.fence));
  return absl::OkStatus();
}

// Returns whether a crashed job gets another attempt: its worker lost the lease or made progress,
// or fewer than kMaxCrashes attempts in a row have crashed without progress.
bool RunningJob::MayTryAgain() const {
  if (!crashed_) return false;
  return lease_lost_ || folder_.HasSaved(job_.fence) || job_.crashes + 1 < kMaxCrashes;
}

// Describes the attempt of a job that is queued again. A stop on request, or a lost lease, does not
// count as a crash.
EndedAttempt RunningJob::DescribeAttempt() const {
  EndedAttempt attempt;
  attempt.progress = folder_.HasSaved(job_.fence);
  if (put_back_) attempt.end = AttemptEnd::kPutBack;
  if (!crashed_ || lease_lost_) return attempt;
  attempt.end = AttemptEnd::kCrashed;
  const std::vector<absl::Duration>& pauses = deps_.options.launch.crash_pauses;
  // The pause grows with each crash in a row; the last one repeats.
  const auto before = static_cast<size_t>(attempt.progress ? 0 : job_.crashes);
  attempt.pause = pauses[std::min(before, pauses.size() - 1)];
  return attempt;
}

absl::Status RunningJob::CommitModel(const JobResult& result) {
  ModelRecord model;
  model.folder = absl::StrCat("jobs/", job_.id, "/", folder_.model(job_.fence).filename().string());
  model.metrics = MetricsToJson(result.metrics);
  model.sources = SourcesToJson(result.sources);
  model.num_gaussians = result.num_gaussians;
  model.num_bytes = result.num_bytes;
  ASSIGN_OR_RETURN(model, deps_.store.queue().CommitModel(job_.id, job_.fence, model));
  spdlog::info("jobs/{}: made {}", job_.id, ChildName(job_.scene, "models", model.number));
  return absl::OkStatus();
}

absl::Status RunningJob::WriteOutcome(const absl::Status& outcome, const JobResult& result,
                                      bool requeue) {
  Store& store = deps_.store;
  if (outcome.ok()) {
    RETURN_IF_ERROR(CommitModel(result));
    ASSIGN_OR_RETURN(job_, store.jobs().GetJob(job_.id));
    // A worker that was stopped because the server stops goes back into the queue. RequeueJob ends
    // the job instead if its cancellation was requested.
  } else if (MayTryAgain() || ((requeue || put_back_) && absl::IsCancelled(outcome))) {
    ASSIGN_OR_RETURN(job_, store.queue().RequeueJob(job_.id, job_.fence, DescribeAttempt()));
  } else {
    ASSIGN_OR_RETURN(job_, store.queue().EndJob(job_.id, job_.fence, ClientStatus(outcome)));
  }
  return absl::OkStatus();
}

// Says in the events of a job that is queued again why.
absl::Status RunningJob::WarnOfRetry(const absl::Status& outcome) const {
  if (put_back_) {
    return AppendWarning(
        folder_, job_,
        "the job is put back into the queue, because a preview waits for a device; "
        "it will resume from its checkpoint");
  }
  if (!crashed_) return absl::OkStatus();
  std::string warning(ClientStatus(outcome).message());
  if (job_.not_before > absl::Now()) {
    absl::StrAppend(&warning, "; it is tried again in ",
                    absl::ToInt64Seconds(job_.not_before - absl::Now()) + 1, " s");
  }
  return AppendWarning(folder_, job_, warning);
}

// Removes what nothing needs after the job's end: checkpoints, frames, masks of SAM.
void RunningJob::RemoveLeftovers() const {
  const bool has_model = job_.state == JobState::kSucceeded;
  folder_.RemoveWorkingFiles(has_model ? folder_.model(job_.fence).filename().string() : "");
}

absl::Status RunningJob::Finish(bool requeue) {
  FollowLog();
  JobResult result;
  absl::Status outcome;
  RETURN_IF_ERROR(ReadOutcome(&result, &outcome));
  if (absl::Status written = WriteOutcome(outcome, result, requeue); !written.ok()) {
    if (!absl::IsAborted(written)) return written;
    // ABORTED also comes when the outcome was written before, and only the database's answer was
    // lost: then the job has this fence and is no longer RUNNING.
    ASSIGN_OR_RETURN(const JobRecord record, deps_.store.jobs().GetJob(job_.id));
    if (record.fence != job_.fence || record.state == JobState::kRunning) return written;
    job_ = record;
  }
  if (job_.state != JobState::kSucceeded) {
    spdlog::warn("jobs/{}: attempt {} ended: {}", job_.id, job_.fence, outcome.ToString());
  }
  // After the outcome is in the store: until then a retry needs the checkpoints. The collector
  // removes what a kill leaves.
  if (IsTerminal(job_.state)) RemoveLeftovers();
  if (job_.state == JobState::kQueued) RETURN_IF_ERROR(WarnOfRetry(outcome));
  std::error_code error;
  // Once the store has the job's end, its scene can be deleted, and this folder with it.
  if (!std::filesystem::exists(folder_.path(), error)) return absl::OkStatus();
  absl::Status written = AppendState(folder_, job_);
  FollowLog();
  return written;
}

}  // namespace pepeseg
