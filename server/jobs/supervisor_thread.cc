#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/jobs/job_events.h"
#include "server/jobs/supervisor.h"
#include "server/store/layout.h"
#include "server/worker_protocol/client_text.h"

namespace pepeseg {
namespace {

// Interval of looking at workers and their logs.
constexpr absl::Duration kLookAtWorkers = absl::Milliseconds(50);
// A job fails when servers have ended during this many attempts in a row that made no progress.
constexpr int kMaxServerEnds = 100;

std::unique_ptr<Launcher> MakeLauncher(const SupervisorOptions& options) {
  if (options.launch.launcher == LaunchOptions::Launcher::kSlurm) {
    return MakeSlurmLauncher(options.launch);
  }
  return MakeProcessLauncher();
}

}  // namespace

Supervisor::Supervisor(Store& store, SupervisorOptions options)
    : store_(store),
      options_(std::move(options)),
      device_use_(options_.devices.size()),
      launcher_(MakeLauncher(options_)) {}

JobFolder Supervisor::FolderOf(const std::string& job) const {
  return JobFolder(JobsFolder(options_.data_folder) / job);
}

absl::Status Supervisor::Recover() {
  ASSIGN_OR_RETURN(const std::vector<JobRecord> jobs, store_.queue().ListRunningJobs());
  for (const JobRecord& job : jobs) {
    // Alone on its database, a server is the holder of all jobs. On a shared one it takes over at
    // once only from a process of this machine that is gone; the leases of others expire.
    if (store_.shared() && !IsKnownGone(job.lease_owner)) continue;
    ASSIGN_OR_RETURN(JobRecord mine, store_.queue().TakeOverJob(job.id, job.lease_owner));
    RETURN_IF_ERROR(RecoverJob(std::move(mine)));
  }
  return absl::OkStatus();
}

// Recovers a job that this server has taken over.
absl::Status Supervisor::RecoverJob(JobRecord job) {
  if (!job.launch.empty()) {
    auto adopted = RunningJob::Adopt({store_, options_, *launcher_}, job,
                                     FindFreeDevice(job.device).value_or(options_.devices.size()));
    if (adopted.ok()) {
      Publish(**adopted);
      running_.push_back(*std::move(adopted));
      return absl::OkStatus();
    }
    spdlog::error("jobs/{}: following {}: {}", job.id, job.launch, adopted.status().ToString());
  }
  const int64_t fence = job.fence;
  const EndedAttempt ended{AttemptEnd::kServerEnded, FolderOf(job.id).HasSaved(fence), {}};
  // A job that brings its server down each time must not do so for ever.
  if (ended.progress || job.server_ends + 1 < kMaxServerEnds) {
    ASSIGN_OR_RETURN(job, store_.queue().RequeueJob(job.id, fence, ended));
  } else {
    ASSIGN_OR_RETURN(
        job, store_.queue().EndJob(job.id, fence,
                                   absl::AbortedError(absl::StrCat(
                                       "the server ended during each of ", job.server_ends + 1,
                                       " attempts in a row that made no progress"))));
  }
  spdlog::warn("jobs/{}: attempt {} was broken off by the end of its server", job.id, fence);
  // An error does not keep the server from starting, since the store has the new state.
  const absl::Status written = AppendState(FolderOf(job.id), job);
  if (!written.ok()) spdlog::error("jobs/{}: {}", job.id, written.ToString());
  return absl::OkStatus();
}

void Supervisor::StartThread() {
  // Jobs that an earlier server has queued may be pausing.
  pauses_end_ = absl::Now() + options_.launch.crash_pauses.back();
  thread_ = std::thread([this] { Run(); });
}

void Supervisor::Wake() {
  const std::lock_guard lock(mutex_);
  woken_ = true;
  wake_.notify_all();
}

void Supervisor::SetClaiming(bool claim) {
  {
    const std::lock_guard lock(mutex_);
    claiming_ = claim;
  }
  Wake();
}

void Supervisor::Stop(absl::Time deadline) {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
    stop_deadline_ = std::min(stop_deadline_, deadline);
  }
  Wake();
  if (thread_.joinable()) thread_.join();
}

// The loop's thread. `running_` and the pauses belong to it alone; mutex_ guards what other threads
// set: cancels_, claiming_, stopping_, woken_. Leases come before ends, so that an end is not
// written for a job that was lost.
void Supervisor::Run() {
  do {
    FollowJobs();
    KeepLeases();
    ApplyCancels();
    FinishJobs(/*requeue=*/false);
    Claim();
    PublishDevices();
  } while (WaitForWork());
  EndAll();
}

void Supervisor::Publish(const RunningJob& running) {
  feed_.SetNewest(running.job().id, {running.sequence(), running.progress()});
}

// Reads the new events of running jobs and publishes them; kills workers that hang.
void Supervisor::FollowJobs() {
  for (const auto& running : running_) {
    running->KillIfTimedOut();
    if (!running->FollowLog()) continue;
    Publish(*running);
    feed_.Notify(running->job().id);
  }
}

// Stops the workers of cancelled jobs. A request stays until the job's end is written, so that the
// worker is killed once its grace has passed.
void Supervisor::ApplyCancels() {
  std::set<std::string> cancels;
  {
    const std::lock_guard lock(mutex_);
    cancels = cancels_;
  }
  for (const auto& running : running_) {
    const std::string& job = running->job().id;
    if (cancels.erase(job) != 0) running->Terminate(options_.cancel_grace);
  }
  // The remaining jobs have no worker here, or no longer.
  for (const std::string& job : cancels) {
    ReportCancelled(job);
    const std::lock_guard lock(mutex_);
    cancels_.erase(job);
  }
}

// Appends the event of a job that was cancelled in the queue, if its log does not have it yet.
void Supervisor::ReportCancelled(const std::string& job) {
  const absl::StatusOr<JobRecord> record = store_.jobs().GetJob(job);
  if (!record.ok() || record->state != JobState::kCancelled) return;
  const absl::StatusOr<v1::JobState> logged = ReadNewestState(FolderOf(job));
  if (!logged.ok()) spdlog::error("jobs/{}: {}", job, logged.status().ToString());
  // The event is there already if this server has been asked twice.
  if (!logged.ok() || *logged == v1::JOB_STATE_CANCELLED) return;
  const absl::Status written = AppendState(FolderOf(job), *record);
  if (!written.ok()) spdlog::error("jobs/{}: {}", job, written.ToString());
  feed_.Notify(job);
}

// Writes the end of each job whose worker has ended. `requeue`: see RunningJob::Finish.
void Supervisor::FinishJobs(bool requeue) {
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
      if (pause.num_failures() > 1) feed_.SetObstacle(job, finished);
      continue;
    }
    if ((*running)->put_back()) kept_for_preview_ = (*running)->device();
    pauses_end_ = std::max(pauses_end_, (*running)->job().not_before);
    // Watchers are notified after the job has left `running_` and the feed, so that they read its
    // final state from the store.
    running_.erase(running);
    feed_.Forget(job);
    {
      const std::lock_guard lock(mutex_);
      cancels_.erase(job);
    }
    feed_.Notify(job);
  }
}

// Renews the leases of running jobs, on a shared database only. Other servers may claim jobs whose
// leases are not renewed and cancel jobs that run here, and a cluster may have restarted a worker.
void Supervisor::KeepLeases() {
  const absl::Time now = absl::Now();
  if (!store_.shared() || running_.empty() || now < next_look_) return;
  next_look_ = now + kLookAtOthers;
  // Leases are renewed four times in their length; in between the jobs are only looked at.
  const bool renew = now >= next_renewal_;
  const absl::StatusOr<std::vector<JobRecord>> held =
      renew ? store_.queue().RenewLeases() : store_.queue().ListHeldJobs();
  if (!held.ok()) {
    // The workers end by themselves when their leases are not renewed in time.
    if (lease_log_.Over()) {
      spdlog::error("renewing the leases of jobs: {}", held.status().ToString());
      lease_log_.Fail();
    }
    return;
  }
  lease_log_.Succeed();
  if (renew) next_renewal_ = now + store_.holder().lease / 4;
  LoseJobs(*held);
  for (const auto& running : running_) {
    for (const JobRecord& record : *held) {
      if (record.id != running->job().id) continue;
      if (renew || record.fence != running->job().fence) running->RenewLease(record);
      if (record.cancel_requested) running->Terminate(options_.cancel_grace);
    }
  }
}

// Abandons the jobs that are not among `held`: another server has taken them over.
void Supervisor::LoseJobs(const std::vector<JobRecord>& held) {
  std::erase_if(running_, [&](const std::unique_ptr<RunningJob>& running) {
    const JobRecord& job = running->job();
    const bool mine = std::any_of(held.begin(), held.end(), [&](const JobRecord& record) {
      // A cluster may have restarted the worker under a new fence; the job is still this server's.
      return record.id == job.id && (record.fence == job.fence || !job.launch.empty());
    });
    if (mine) return false;
    running->Abandon();
    feed_.Forget(job.id);
    return true;
  });
}

bool Supervisor::WaitForWork() {
  std::unique_lock lock(mutex_);
  const auto woken = [this] { return woken_ || stopping_; };
  const bool paused = absl::Now() < pauses_end_ + kLookAtOthers;
  if (running_.empty() && (store_.shared() || unsure_ || paused)) {
    // Nothing wakes this thread when another server queues or loses a job, when the database is
    // reachable again, or when a pause ends.
    wake_.wait_for(lock, absl::ToChronoMilliseconds(kLookAtOthers), woken);
  } else if (running_.empty()) {
    wake_.wait(lock, woken);
  } else {
    wake_.wait_for(lock, absl::ToChronoMilliseconds(kLookAtWorkers), woken);
  }
  woken_ = false;
  return !stopping_;
}

// Stops all workers, and kills those that still run at the deadline.
void Supervisor::EndAll() {
  while (!running_.empty()) {
    absl::Time deadline;
    {
      const std::lock_guard lock(mutex_);
      deadline = stop_deadline_;
    }
    FollowJobs();
    // The grace shrinks at each round, so a worker that does not stop is killed at the deadline.
    for (const auto& running : running_) running->Terminate(deadline - absl::Now());
    FinishJobs(/*requeue=*/true);
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    // A store that keeps failing must not hold up the server: the next Recover() writes the rest.
    if (absl::Now() > deadline + absl::Seconds(5)) running_.clear();
  }
}

}  // namespace pepeseg
