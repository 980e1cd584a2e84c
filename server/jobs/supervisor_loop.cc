#include "server/jobs/supervisor_loop.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/jobs/holder_name.h"
#include "server/jobs/job_events.h"
#include "server/jobs/slurm.h"

namespace pepeseg {
namespace {

std::unique_ptr<Launcher> MakeLauncher(const SupervisorOptions& options) {
  if (options.launch.launcher == LaunchOptions::Launcher::kSlurm) {
    return MakeSlurmLauncher(options.launch);
  }
  return MakeProcessLauncher();
}

}  // namespace

Supervisor::Loop::Loop(Store& store, SupervisorOptions options)
    : store_(store), options_(std::move(options)), launcher_(MakeLauncher(options_)) {}

Supervisor::Loop::~Loop() { StopThread(absl::Now()); }

JobFolder Supervisor::Loop::FolderOf(const std::string& job) const {
  return JobFolder(options_.data_folder / "jobs" / job);
}

absl::Status Supervisor::Loop::Recover() {
  ASSIGN_OR_RETURN(const std::vector<JobRow> jobs, store_.queue().ListRunningJobs());
  for (const JobRow& job : jobs) {
    if (store_.shared() && !IsKnownGone(job.lease_owner)) continue;
    ASSIGN_OR_RETURN(JobRow mine, store_.queue().TakeOverJob(job.id, job.lease_owner));
    RETURN_IF_ERROR(RecoverJob(std::move(mine)));
  }
  return absl::OkStatus();
}

// Recovers a job that this server has taken over.
absl::Status Supervisor::Loop::RecoverJob(JobRow job) {
  if (!job.launch.empty()) {
    auto adopted = RunningJob::Adopt({store_, options_, *launcher_}, job);
    if (adopted.ok()) {
      Publish(**adopted);
      running_.push_back(*std::move(adopted));
      return absl::OkStatus();
    }
    spdlog::error("jobs/{}: following {}: {}", job.id, job.launch, adopted.status().ToString());
  }
  const int64_t fence = job.fence;
  const EndedAttempt ended{AttemptEnd::kServerEnded, FolderOf(job.id).HasSaved(fence), {}};
  if (ended.progress || job.server_ends + 1 < options_.max_server_ends) {
    ASSIGN_OR_RETURN(job, store_.queue().RequeueJob(job.id, fence, ended));
  } else {
    ASSIGN_OR_RETURN(
        job, store_.queue().EndJob(job.id, fence,
                                   absl::AbortedError(absl::StrCat(
                                       "the server ended during each of ", job.server_ends + 1,
                                       " attempts in a row that made no progress"))));
  }
  spdlog::warn("jobs/{}: attempt {} was broken off by the end of its server", job.id, fence);
  // The server starts all the same: the store has the new state.
  const absl::Status told = AppendState(FolderOf(job.id), job);
  if (!told.ok()) spdlog::error("jobs/{}: {}", job.id, told.ToString());
  return absl::OkStatus();
}

void Supervisor::Loop::StartThread() {
  pauses_end_ =
      absl::Now() + options_.launch.crash_pauses.back();  // of jobs that an earlier server queued
  thread_ = std::thread([this] { Run(); });
}

void Supervisor::Loop::Wake() {
  const std::lock_guard lock(mutex_);
  woken_ = true;
  wake_.notify_all();
}

void Supervisor::Loop::WishCancel(const std::string& job) {
  {
    const std::lock_guard lock(mutex_);
    cancels_.insert(job);
  }
  Wake();
}

void Supervisor::Loop::WishClaims(bool claim) {
  {
    const std::lock_guard lock(mutex_);
    claiming_ = claim;
  }
  Wake();
}

void Supervisor::Loop::StopThread(absl::Time deadline) {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
    stop_deadline_ = std::min(stop_deadline_, deadline);
  }
  Wake();
  if (thread_.joinable()) thread_.join();
}

std::optional<Supervisor::Newest> Supervisor::Loop::FindRunning(const std::string& job) const {
  const std::lock_guard lock(mutex_);
  const auto found = newest_.find(job);
  return found == newest_.end() ? std::nullopt : std::optional(found->second);
}

absl::Status Supervisor::Loop::FindObstacle(const std::string& job, bool queued) const {
  const std::lock_guard lock(mutex_);
  auto found = obstacles_.find(job);
  if (found == obstacles_.end() && queued) found = obstacles_.find("");
  return found == obstacles_.end() ? absl::OkStatus() : found->second;
}

void Supervisor::Loop::SetObstacle(const std::string& job, const absl::Status& error) {
  {
    const std::lock_guard lock(mutex_);
    obstacles_[job] = error;
  }
  watches_.Notify(job);
}

void Supervisor::Loop::ClearObstacle(const std::string& job) {
  const std::lock_guard lock(mutex_);
  obstacles_.erase(job);
}

void Supervisor::Loop::Forget(const std::string& job) {
  const std::lock_guard lock(mutex_);
  newest_.erase(job);
  obstacles_.erase(job);
}

void Supervisor::Loop::Run() {
  do {
    FollowJobs();
    KeepLeases();
    ApplyCancels();
    FinishJobs(/*requeue=*/false);
    Claim();
  } while (WaitForWork());
  EndAll();
}

void Supervisor::Loop::Publish(const RunningJob& running) {
  const std::lock_guard lock(mutex_);
  newest_[running.job().id] = {running.sequence(), running.progress()};
}

void Supervisor::Loop::FollowJobs() {
  for (const auto& running : running_) {
    running->KillIfSilent();
    if (!running->FollowLog()) continue;
    Publish(*running);
    watches_.Notify(running->job().id);
  }
}

void Supervisor::Loop::ApplyCancels() {
  std::set<std::string> cancels;
  {
    const std::lock_guard lock(mutex_);
    cancels = cancels_;
  }
  for (const auto& running : running_) {
    const std::string& job = running->job().id;
    if (cancels.erase(job) != 0) running->Terminate(options_.cancel_grace);
  }
  // The others have no worker yet, or no longer.
  for (const std::string& job : cancels) {
    TellCancelled(job);
    const std::lock_guard lock(mutex_);
    cancels_.erase(job);
  }
}

// Appends the event of a job that was cancelled in the queue, if its log does not have it yet.
void Supervisor::Loop::TellCancelled(const std::string& job) {
  const absl::StatusOr<JobRow> row = store_.jobs().GetJob(job);
  if (!row.ok() || row->state != JobState::kCancelled) return;
  v1::JobState newest = v1::JOB_STATE_UNSPECIFIED;
  EventLogReader log(FolderOf(job).events());
  while (true) {
    const absl::StatusOr<std::vector<v1::JobEvent>> events = log.Read();
    if (!events.ok()) spdlog::error("jobs/{}: {}", job, events.status().ToString());
    if (!events.ok() && !absl::IsDataLoss(events.status())) return;
    if (!events.ok() || events->empty()) break;
    for (const v1::JobEvent& event : *events) {
      if (event.has_state_changed()) newest = event.state_changed().state();
    }
  }
  if (newest == v1::JOB_STATE_CANCELLED) return;
  const absl::Status told = AppendState(FolderOf(job), *row);
  if (!told.ok()) spdlog::error("jobs/{}: {}", job, told.ToString());
  watches_.Notify(job);
}

void Supervisor::Loop::FinishJobs(bool requeue) {
  for (auto next = running_.begin(); next != running_.end();) {
    const auto running = next++;
    RetryPause& pause = (*running)->end_pause();
    // A server that is stopping has no time for long pauses.
    if (!pause.Over(requeue ? absl::Seconds(1) : absl::InfiniteDuration())) continue;
    if (!(*running)->Ended()) continue;
    const std::string job = (*running)->job().id;
    const absl::Status finished = (*running)->Finish(requeue);
    if (!finished.ok()) spdlog::error("jobs/{}: writing its end: {}", job, finished.ToString());
    // The disk may be full for a while, or the database unreachable: the end is written later, and
    // watchers get the obstacle. ABORTED: another server has taken the job over and writes its end.
    if (!finished.ok() && !absl::IsAborted(finished) && !absl::IsNotFound(finished)) {
      pause.Fail();
      if (pause.num_failures() > 1) SetObstacle(job, finished);
      continue;
    }
    pauses_end_ = std::max(pauses_end_, (*running)->job().not_before);
    running_.erase(running);
    Forget(job);
    {
      const std::lock_guard lock(mutex_);
      cancels_.erase(job);
    }
    watches_.Notify(job);
  }
}

bool Supervisor::Loop::WaitForWork() {
  std::unique_lock lock(mutex_);
  const auto woken = [this] { return woken_ || stopping_; };
  const bool paused = absl::Now() < pauses_end_ + kLookAtOthers;
  if (running_.empty() && (store_.shared() || unsure_ || paused)) {
    // Nothing wakes this thread when other servers queue or lose jobs, the database is reachable
    // again, or a pause ends.
    wake_.wait_for(lock, absl::ToChronoMilliseconds(kLookAtOthers), woken);
  } else if (running_.empty()) {
    wake_.wait(lock, woken);
  } else {
    wake_.wait_for(lock, absl::ToChronoMilliseconds(options_.poll), woken);
  }
  woken_ = false;
  return !stopping_;
}

// Stops all workers, and kills those that still run at the deadline.
void Supervisor::Loop::EndAll() {
  while (!running_.empty()) {
    absl::Time deadline;
    {
      const std::lock_guard lock(mutex_);
      deadline = stop_deadline_;
    }
    FollowJobs();
    for (const auto& running : running_) running->Terminate(deadline - absl::Now());
    FinishJobs(/*requeue=*/true);
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    // A store that keeps failing must not hold up the server: Recover() does the rest.
    if (absl::Now() > deadline + absl::Seconds(5)) running_.clear();
  }
}

}  // namespace pepeseg
