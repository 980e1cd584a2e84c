// How the supervisor claims jobs and starts them: the parts of its thread's loop that deal with
// devices.
#include <spdlog/spdlog.h>

#include <algorithm>
#include <tuple>

#include "absl/strings/str_cat.h"
#include "server/jobs/job_events.h"
#include "server/jobs/supervisor.h"
#include "server/worker_protocol/client_text.h"

namespace pepeseg {

bool Supervisor::MayClaim() const {
  const std::lock_guard lock(mutex_);
  return claiming_ && !stopping_;
}

// Returns a device without a job, the one with this name if it is free; nothing: all are taken.
std::optional<size_t> Supervisor::FindFreeDevice(const std::string& name) const {
  std::vector<bool> taken(options_.devices.size() + 1);
  for (const auto& running : running_) taken[running->device()] = true;
  std::optional<size_t> free;
  for (size_t i = options_.devices.size(); i-- > 0;) {
    if (taken[i]) continue;
    if (options_.devices[i].name == name) return i;
    free = i;
  }
  return free;
}

// Reports to other threads which job runs where.
void Supervisor::PublishDevices() {
  std::vector<std::string> jobs(options_.devices.size() + 1);
  for (const auto& running : running_) jobs[running->device()] = running->job().id;
  device_use_.Set(jobs);
}

// Pauses claims after `error` has stopped the start of `job`, or a claim if `job` is empty. Reports
// the obstacle from the second failure in a row on: most errors are over by then.
void Supervisor::PauseClaims(const std::string& job, const absl::Status& error) {
  unsure_ = true;
  claim_pause_.Fail();
  if (claim_pause_.num_failures() > 1) feed_.SetObstacle(job, error);
}

// Claims queued jobs while devices are free, and makes room for a preview if none is.
void Supervisor::Claim() {
  if (!claim_pause_.Over()) return;
  // Before the next claim: after an error this server does not know which jobs it holds.
  if (unsure_ && MayClaim() && FindFreeDevice()) StartHeld();
  ClaimWhileFree();
  if (!unsure_) MakeRoomForPreview();
}

void Supervisor::ClaimWhileFree() {
  while (!unsure_ && MayClaim()) {
    const std::optional<size_t> device = FindFreeDevice();
    if (!device) return;
    const bool for_preview = device == kept_for_preview_;
    const absl::StatusOr<std::optional<JobRecord>> job =
        store_.queue().ClaimJob(options_.devices[*device].name,
                                for_preview ? JobQueue::Claims::kPreviews : JobQueue::Claims::kAll);
    if (!job.ok()) {
      spdlog::error("claiming a job: {}", job.status().ToString());
      PauseClaims("", job.status());
      return;
    }
    claim_pause_.Succeed();
    feed_.ClearObstacle("");
    // The preview has started, or waits no longer: another device has taken it, or it was
    // cancelled.
    if (for_preview) kept_for_preview_.reset();
    if (job->has_value()) {
      StartJob(**job, *device);
    } else if (!for_preview) {
      return;
    }
  }
}

// Starts the jobs that this server holds by the database but does not run: the answer to its claim
// was lost, or the database was unreachable when they were to start.
void Supervisor::StartHeld() {
  const absl::StatusOr<std::vector<JobRecord>> held = store_.queue().ListHeldJobs();
  if (!held.ok()) {
    spdlog::error("asking for the jobs of this server: {}", held.status().ToString());
    PauseClaims("", held.status());
    return;
  }
  unsure_ = false;
  next_renewal_ = absl::InfinitePast();  // their leases may be old
  feed_.KeepObstaclesOf(*held);
  for (const JobRecord& job : *held) {
    const bool runs = std::any_of(running_.begin(), running_.end(),
                                  [&](const auto& running) { return running->job().id == job.id; });
    if (runs) continue;
    const std::optional<size_t> device = FindFreeDevice(job.device);
    if (device) StartJob(job, *device);
    unsure_ |= !device;  // looks again when a device is free
  }
}

// Starts a claimed job, or follows its worker if a cluster runs it already.
void Supervisor::StartJob(const JobRecord& job, size_t device) {
  const RunningJob::Dependencies context{store_, options_, *launcher_};
  absl::StatusOr<std::unique_ptr<RunningJob>> started =
      job.launch.empty() ? RunningJob::Start(context, job, device)
                         : RunningJob::Adopt(context, job, device);
  if (started.ok()) {
    if (job.cancel_requested) (*started)->Terminate(options_.cancel_grace);
    Publish(**started);
    feed_.ClearObstacle("");
    feed_.ClearObstacle(job.id);
    running_.push_back(std::move(started).value());
    // StartHeld tries again: the job stays RUNNING and held by this server.
  } else if (absl::IsUnavailable(started.status())) {
    // The job has not failed.
    spdlog::error("jobs/{}: does not start yet: {}", job.id, started.status().ToString());
    PauseClaims(job.id, started.status());
  } else {
    EndUnstarted(job, started.status());
  }
  feed_.Notify(job.id);
}

// Writes the end of a job that cannot be started.
void Supervisor::EndUnstarted(const JobRecord& job, const absl::Status& error) {
  spdlog::error("jobs/{}: did not start: {}", job.id, error.ToString());
  const absl::StatusOr<JobRecord> ended =
      store_.queue().EndJob(job.id, job.fence, ClientStatus(error));
  if (!ended.ok()) {
    // It is tried again, unless the end was written and only the answer was lost.
    PauseClaims(job.id, ended.status());
    return;
  }
  // The store has the end; WatchJob reports it from there if the event is missing.
  AppendState(FolderOf(job.id), *ended).IgnoreError();
  feed_.ClearObstacle(job.id);
}

// Returns the running job to put back for a preview: of those that may be, one that was put back
// the fewest times, then the one that has run for the longest. nullptr: there is none, or a job is
// on its way back already.
RunningJob* Supervisor::FindVictim() const {
  RunningJob* victim = nullptr;
  const auto order = [](const RunningJob& running) {
    return std::tuple(running.job().put_backs, running.job().start_time);
  };
  for (const auto& running : running_) {
    if (running->put_back()) return nullptr;
    if (!running->MayBePutBack()) continue;
    if (victim == nullptr || order(*running) < order(*victim)) victim = running.get();
  }
  return victim;
}

// Puts a job back if a preview waits and no device is free. On a shared database it does so only
// when the same preview waits at two looks in a row: another server may have a free device.
void Supervisor::MakeRoomForPreview() {
  const absl::Time now = absl::Now();
  if (now < next_preview_look_ || !MayClaim() || FindFreeDevice()) return;
  next_preview_look_ = now + kLookAtOthers;
  RunningJob* const victim = FindVictim();
  const absl::StatusOr<std::string> preview =
      victim == nullptr ? std::string() : store_.queue().FindPreview();
  if (!preview.ok()) {
    spdlog::error("looking for a preview: {}", preview.status().ToString());
    return;
  }
  const bool waited = *preview == waiting_preview_;
  waiting_preview_ = *preview;
  if (preview->empty() || (store_.shared() && !waited)) return;
  spdlog::info("jobs/{}: put back into the queue for jobs/{}, a preview", victim->job().id,
               *preview);
  victim->PutBack(options_.cancel_grace);
  waiting_preview_.clear();
}

}  // namespace pepeseg
