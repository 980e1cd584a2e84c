#include "server/jobs/supervisor.h"

#include <spdlog/spdlog.h>
#include <unistd.h>

#include <string>

#include "core/base/status_macros.h"
#include "server/jobs/supervisor_loop.h"
#include "server/worker_protocol/landlock_version.h"

namespace pepeseg {

namespace {

// Warns once, in the server's log, where the sandbox is missing or incomplete. On a cluster each
// node's kernel counts, and the worker's log has the same line.
void ReportSandbox(const SupervisorOptions& options) {
  if (!options.workers.sandbox) {
    spdlog::warn("--sandbox=off: jobs read and write every file of this user");
  } else if (options.launch.launcher == LaunchOptions::Launcher::kProcess) {
    const std::string missing = MissingFromSandbox(LandlockVersion());
    if (!missing.empty()) spdlog::warn("sandbox: {}", missing);
  }
}

}  // namespace

Supervisor::Supervisor(std::unique_ptr<Loop> loop) : loop_(std::move(loop)) {}
Supervisor::~Supervisor() = default;

absl::StatusOr<std::unique_ptr<Supervisor>> Supervisor::Start(Store& store,
                                                              SupervisorOptions options) {
  if (access(options.worker.c_str(), X_OK) != 0) {
    return absl::NotFoundError(options.worker.string() + ": no program to run jobs with");
  }
  ReportSandbox(options);
  auto loop = std::make_unique<Loop>(store, std::move(options));
  RETURN_IF_ERROR(loop->Recover());
  loop->StartThread();
  return std::unique_ptr<Supervisor>(new Supervisor(std::move(loop)));
}

absl::StatusOr<JobRow> Supervisor::Submit(const JobRow& job) {
  ASSIGN_OR_RETURN(JobRow made, loop_->store().jobs().CreateJob(job));
  loop_->Wake();
  return made;
}

absl::StatusOr<JobRow> Supervisor::Cancel(const std::string& job) {
  ASSIGN_OR_RETURN(JobRow row, loop_->store().queue().RequestCancel(job));
  if (row.cancel_requested) loop_->WishCancel(row.id);
  return row;
}

void Supervisor::StopClaiming() { loop_->WishClaims(false); }

void Supervisor::ResumeClaiming() { loop_->WishClaims(true); }

void Supervisor::Stop(absl::Time deadline) { loop_->StopThread(deadline); }

EventLogReader Supervisor::ReadEvents(const std::string& job, int64_t after_sequence) const {
  return EventLogReader(loop_->FolderOf(job).events(), after_sequence);
}

absl::StatusOr<Supervisor::Newest> Supervisor::FindNewest(const std::string& job) const {
  if (std::optional<Newest> running = loop_->FindRunning(job)) return *running;
  Newest newest;
  EventLogReader reader = ReadEvents(job, 0);
  while (true) {
    ASSIGN_OR_RETURN(const std::vector<v1::JobEvent> events, reader.Read());
    if (events.empty()) return newest;
    newest.sequence = events.back().sequence();
    for (const v1::JobEvent& event : events) {
      if (event.has_progress()) newest.progress = event.progress();
    }
  }
}

std::optional<Supervisor::Newest> Supervisor::FindRunning(const std::string& job) const {
  return loop_->FindRunning(job);
}

absl::Status Supervisor::FindObstacle(const std::string& job, bool queued) const {
  return loop_->FindObstacle(job, queued);
}

std::unique_ptr<Supervisor::Watch> Supervisor::AddWatch(const std::string& job,
                                                        std::function<void()> changed) {
  return loop_->watches().Add(job, std::move(changed));
}

}  // namespace pepeseg
