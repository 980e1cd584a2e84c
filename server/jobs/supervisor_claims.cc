// Which jobs this server has: claims, leases, and their loss.
#include <spdlog/spdlog.h>

#include <algorithm>

#include "server/jobs/job_events.h"
#include "server/jobs/supervisor_loop.h"
#include "server/worker_protocol/client_text.h"

namespace pepeseg {

bool Supervisor::Loop::MayStart() const {
  const std::lock_guard lock(mutex_);
  return claiming_ && !stopping_ && running_.size() < static_cast<size_t>(options_.num_slots);
}

// Pauses claims after `error` has stopped the start of `job`; empty: a claim.
void Supervisor::Loop::PauseClaims(const std::string& job, const absl::Status& error) {
  unsure_ = true;
  claim_pause_.Fail();
  if (claim_pause_.num_failures() > 1) SetObstacle(job, error);
}

void Supervisor::Loop::Claim() {
  if (!claim_pause_.Over()) return;
  if (unsure_ && MayStart()) StartHeld();
  while (!unsure_ && MayStart()) {
    const absl::StatusOr<std::optional<JobRow>> job = store_.queue().ClaimJob(options_.device_name);
    if (!job.ok()) {
      spdlog::error("claiming a job: {}", job.status().ToString());
      PauseClaims("", job.status());
      return;
    }
    claim_pause_.Succeed();
    ClearObstacle("");
    if (!job->has_value()) return;
    StartJob(**job);
  }
}

// Starts the jobs that this server holds by the database but does not run: the answer to its claim
// was lost, or the database was unreachable when they were to start.
void Supervisor::Loop::StartHeld() {
  const absl::StatusOr<std::vector<JobRow>> held = store_.queue().ListHeldJobs();
  if (!held.ok()) {
    spdlog::error("asking for the jobs of this server: {}", held.status().ToString());
    PauseClaims("", held.status());
    return;
  }
  unsure_ = false;
  next_renewal_ = absl::InfinitePast();  // their leases may be old
  KeepObstaclesOf(*held);
  for (const JobRow& job : *held) {
    const bool runs = std::any_of(running_.begin(), running_.end(),
                                  [&](const auto& running) { return running->job().id == job.id; });
    if (!runs) StartJob(job);
  }
}

// Removes the obstacles of jobs that are no longer held: their end was written, and only the answer
// was lost.
void Supervisor::Loop::KeepObstaclesOf(const std::vector<JobRow>& held) {
  const std::lock_guard lock(mutex_);
  std::erase_if(obstacles_, [&](const auto& obstacle) {
    return !obstacle.first.empty() &&
           std::none_of(held.begin(), held.end(),
                        [&](const JobRow& row) { return row.id == obstacle.first; });
  });
}

void Supervisor::Loop::StartJob(const JobRow& job) {
  const RunningJob::Context context{store_, options_, *launcher_};
  absl::StatusOr<std::unique_ptr<RunningJob>> started =
      job.launch.empty() ? RunningJob::Start(context, job) : RunningJob::Adopt(context, job);
  if (started.ok()) {
    if (job.cancel_requested) (*started)->Terminate(options_.cancel_grace);
    Publish(**started);
    ClearObstacle("");
    ClearObstacle(job.id);
    running_.push_back(std::move(started).value());
  } else if (absl::IsUnavailable(started.status())) {
    // The job has not failed.
    spdlog::error("jobs/{}: does not start yet: {}", job.id, started.status().ToString());
    PauseClaims(job.id, started.status());
  } else {
    EndUnstarted(job, started.status());
  }
  watches_.Notify(job.id);
}

void Supervisor::Loop::EndUnstarted(const JobRow& job, const absl::Status& error) {
  spdlog::error("jobs/{}: did not start: {}", job.id, error.ToString());
  const absl::StatusOr<JobRow> ended =
      store_.queue().EndJob(job.id, job.fence, ClientStatus(error));
  if (!ended.ok()) {
    // It is tried again, unless the end was written and only the answer was lost.
    PauseClaims(job.id, ended.status());
    return;
  }
  AppendState(FolderOf(job.id), *ended).IgnoreError();
  ClearObstacle(job.id);
}

// Renews the leases of running jobs, on a shared database only. Other servers may claim jobs whose
// leases are not renewed and cancel jobs that run here, and a cluster may have restarted a worker.
void Supervisor::Loop::KeepLeases() {
  const absl::Time now = absl::Now();
  if (!store_.shared() || running_.empty() || now < next_look_) return;
  next_look_ = now + kLookAtOthers;
  const bool renew = now >= next_renewal_;
  const absl::StatusOr<std::vector<JobRow>> held =
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
    for (const JobRow& row : *held) {
      if (row.id != running->job().id) continue;
      if (renew || row.fence != running->job().fence) running->Held(row);
      if (row.cancel_requested) running->Terminate(options_.cancel_grace);
    }
  }
}

// Forgets the jobs that are not among `held`.
void Supervisor::Loop::LoseJobs(const std::vector<JobRow>& held) {
  std::erase_if(running_, [&](const std::unique_ptr<RunningJob>& running) {
    const JobRow& job = running->job();
    const bool mine = std::any_of(held.begin(), held.end(), [&](const JobRow& row) {
      return row.id == job.id && (row.fence == job.fence || !job.launch.empty());
    });
    if (mine) return false;
    running->Abandon();
    Forget(job.id);
    return true;
  });
}

}  // namespace pepeseg
