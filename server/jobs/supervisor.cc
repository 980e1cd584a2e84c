#include "server/jobs/supervisor.h"

#include <spdlog/spdlog.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <system_error>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "core/base/status_macros.h"
#include "server/worker_protocol/job_isolation.h"

namespace pepeseg {
namespace {

// Warns in the server's log if the sandbox is off, or this kernel cannot enforce all of it. Workers
// on a cluster run on the kernels of their nodes, and log the same line themselves.
void ReportSandbox(const SupervisorOptions& options) {
  if (!options.workers.sandbox) {
    spdlog::warn("--sandbox=off: jobs read and write every file of this user");
  } else if (options.launch.launcher == LaunchOptions::Launcher::kProcess) {
    const std::string missing = MissingFromSandbox(LandlockVersion());
    if (!missing.empty()) spdlog::warn("sandbox: {}", missing);
  }
}

// Returns an id of the processes that see each other's process ids: machine and process namespace.
// Empty: unknown.
std::string ProcessSpace() {
  std::string boot;
  std::ifstream("/proc/sys/kernel/random/boot_id") >> boot;
  std::error_code error;
  const auto names = std::filesystem::read_symlink("/proc/self/ns/pid", error);  // "pid:[4026..]"
  if (boot.empty() || error) return "";
  return absl::StrCat(boot, "/", names.string());
}

// Returns the start time of a process in clock ticks since boot, or an empty string if there is no
// such process.
std::string StartTime(int64_t pid) {
  std::ifstream file(absl::StrCat("/proc/", pid, "/stat"));
  std::string text;
  std::getline(file, text);
  const size_t name_end = text.rfind(')');  // the name may have spaces and parentheses, too
  if (name_end == std::string::npos) return "";
  constexpr size_t kStartTime = 20;  // number of the field among those after the name, from 1
  const std::vector<std::string> fields =
      absl::StrSplit(text.substr(name_end + 1), ' ', absl::SkipEmpty());
  return fields.size() < kStartTime ? "" : fields[kStartTime - 1];
}

}  // namespace

Supervisor::~Supervisor() { Stop(absl::Now()); }

absl::StatusOr<std::unique_ptr<Supervisor>> Supervisor::Start(Store& store,
                                                              SupervisorOptions options) {
  if (access(options.worker.c_str(), X_OK) != 0) {
    return absl::NotFoundError(options.worker.string() +
                               " is not a program; jobs need pepeseg-worker");
  }
  ReportSandbox(options);
  std::unique_ptr<Supervisor> supervisor(new Supervisor(store, std::move(options)));
  // Before the thread starts, so that no job is claimed while this server's old ones are taken
  // over.
  RETURN_IF_ERROR(supervisor->Recover());
  supervisor->StartThread();
  return supervisor;
}

absl::StatusOr<JobRecord> Supervisor::Submit(const JobRecord& job) {
  ASSIGN_OR_RETURN(JobRecord made, store_.jobs().CreateJob(job));
  Wake();
  return made;
}

absl::StatusOr<JobRecord> Supervisor::Cancel(const std::string& job) {
  ASSIGN_OR_RETURN(JobRecord record, store_.queue().RequestCancel(job));
  // The database has the request first: if this server is killed now, the next holder of the job
  // sees it. Another server's job is stopped by its holder (KeepLeases).
  if (record.cancel_requested) {
    {
      const std::lock_guard lock(mutex_);
      cancels_.insert(record.id);
    }
    Wake();
  }
  return record;
}

void Supervisor::StopClaiming() { SetClaiming(false); }

void Supervisor::ResumeClaiming() { SetClaiming(true); }

EventLogReader Supervisor::ReadEvents(const std::string& job, int64_t after_sequence) const {
  return EventLogReader(FolderOf(job).events(), after_sequence);
}

// Reads the whole log of a job that does not run here: it is finished, queued, or another server's.
absl::StatusOr<Supervisor::Newest> Supervisor::FindNewest(const std::string& job) const {
  if (std::optional<Newest> running = feed_.FindNewest(job)) return *running;
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
  return feed_.FindNewest(job);
}

absl::Status Supervisor::FindObstacle(const std::string& job, bool queued) const {
  return feed_.FindObstacle(job, queued);
}

std::unique_ptr<Supervisor::Watch> Supervisor::AddWatch(const std::string& job,
                                                        std::function<void()> changed) {
  return feed_.AddWatch(job, std::move(changed));
}

std::string HolderName() {
  const int64_t pid = getpid();
  // The start time distinguishes the process from a later one with the same id.
  return absl::StrCat(ProcessSpace(), "/", pid, "/", StartTime(pid));
}

bool IsKnownGone(const std::string& holder) {
  const std::string space = ProcessSpace();
  // A process of another machine, or of another container, cannot be seen from here. After a reboot
  // the boot id differs: then the lease must expire.
  if (space.empty() || !holder.starts_with(space + "/")) return false;
  const std::vector<std::string> parts = absl::StrSplit(holder.substr(space.size() + 1), '/');
  int64_t pid = 0;
  if (parts.size() != 2 || !absl::SimpleAtoi(parts[0], &pid)) return false;
  return StartTime(pid) != parts[1];
}

}  // namespace pepeseg
