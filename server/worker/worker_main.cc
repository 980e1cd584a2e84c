// pepeseg-worker: runs one job in a process of its own, so that a crash, or a file that was made to
// cause one, ends the job and never the service. Started by the supervisor; by hand, without
// --parent, it runs the job of a folder to its end. With --photograph it decodes one photograph
// instead (photograph_task.h).
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <memory>
#include <new>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "core/base/child_process.h"
#include "core/base/file_error.h"
#include "core/base/status_macros.h"
#include "server/observe/log.h"
#include "server/observe/trace_context.h"
#include "server/store/store.h"
#include "server/worker/sandbox/worker_limits.h"
#include "server/worker/sandbox/worker_sandbox.h"
#include "server/worker/worker_inputs.h"
#include "server/worker/worker_job.h"
#include "server/worker/worker_photograph.h"
#include "server/worker_protocol/job_environment.h"
#include "server/worker_protocol/pulse.h"

namespace pepeseg {
namespace {

// The handler's only way to the job.
StopSwitch stop_switch;

void OnTerminate(int) {
  // Where nobody polls there is nothing to save either: what counts is written manifest last.
  if (!stop_switch.polled) _exit(static_cast<int>(WorkerExit::kCancelled));
  stop_switch.stop = true;
}

struct Arguments {
  std::string folder;
  std::string photograph;  // FormatPhotographTask's
  std::string lpips_weights;
  PriorsCommand priors;
  std::string sam;
  std::string colmap = "colmap";
  int64_t fence = 0;
  pid_t parent = 0;
  bool sandbox = true;
  std::vector<std::string> environment;    // names of variables, besides those of every job
  std::vector<std::string> sandbox_reads;  // files and folders, besides what every job reads
  LogFormat log_format = LogFormat::kText;
};

constexpr char kUsage[] =
    "usage: pepeseg-worker --job=FOLDER [--fence=N] [--parent=PID] "
    "[--lpips-weights=FILE.onnx] [--colmap=PROGRAM] [--priors-command=PROGRAM] "
    "[--priors-seconds=N] [--sam=FOLDER] [--log-format=text|json] [--sandbox=on|off] "
    "[--sandbox-read=PATH]... "
    "[--pass-environment=NAME]...\n"
    "       pepeseg-worker --photograph=TASK [--parent=PID] [--sandbox=on|off] < IMAGE > ANSWER";

// The text behind "--NAME=".
bool TakeFlag(const std::string& word, const char* name, std::string* value) {
  if (!word.starts_with(name)) return false;
  *value = word.substr(std::strlen(name));
  return true;
}

bool Parse(int argc, char** argv, Arguments* arguments) {
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    std::string text;
    int64_t seconds = 0;
    if (TakeFlag(word, "--job=", &arguments->folder) ||
        TakeFlag(word, "--photograph=", &arguments->photograph) ||
        TakeFlag(word, "--lpips-weights=", &arguments->lpips_weights) ||
        TakeFlag(word, "--sam=", &arguments->sam) ||
        TakeFlag(word, "--colmap=", &arguments->colmap)) {
      continue;
    }
    if (TakeFlag(word, "--priors-command=", &text)) {
      arguments->priors.program = text;
    } else if (TakeFlag(word, "--sandbox-read=", &text)) {
      arguments->sandbox_reads.push_back(text);
    } else if (TakeFlag(word, "--pass-environment=", &text)) {
      arguments->environment.push_back(text);
    } else if (TakeFlag(word, "--priors-seconds=", &text)) {
      if (!absl::SimpleAtoi(text, &seconds) || seconds < 1) return false;
      arguments->priors.time_limit = absl::Seconds(seconds);
    } else if (TakeFlag(word, "--sandbox=", &text)) {
      if (text != "on" && text != "off") return false;
      arguments->sandbox = text == "on";
    } else if (TakeFlag(word, "--log-format=", &text)) {
      const auto format = LogFormatOf(text);
      if (!format) return false;
      arguments->log_format = *format;
    } else if (TakeFlag(word, "--fence=", &text)) {
      if (!absl::SimpleAtoi(text, &arguments->fence) || arguments->fence < 1) return false;
    } else if (!TakeFlag(word, "--parent=", &text) || !absl::SimpleAtoi(text, &arguments->parent)) {
      return false;
    }
  }
  return arguments->folder.empty() != arguments->photograph.empty();
}

absl::StatusOr<JobResult> RunWithinMemory(const WorkerJob& job) {
  try {
    return RunWorkerJob(job);
  } catch (const std::bad_alloc&) {
    // Thrown by the standard library, not by us; caught where the job can still say so.
    return absl::ResourceExhaustedError(
        absl::StrCat("out of memory: the job may take ", MemoryLimit() >> 20,
                     " MiB; smaller images (image_scale) or fewer Gaussians take less"));
  }
}

WorkerExit ExitOf(const absl::Status& status) {
  if (status.ok()) return WorkerExit::kSucceeded;
  return absl::IsCancelled(status) ? WorkerExit::kCancelled : WorkerExit::kFailed;
}

using EventLog = absl::StatusOr<std::unique_ptr<EventLogWriter>>;

WorkerExit RunJob(const JobFolder& folder, const JobSpec& spec, const Arguments& arguments,
                  const EventLog& log) {
  JobResult result;
  std::vector<std::string> damaged;
  result.status = log.status();
  if (log.ok()) {
    absl::StatusOr<JobResult> made =
        RunWithinMemory({folder, spec, **log, stop_switch, arguments.lpips_weights,
                         arguments.colmap, arguments.priors, damaged, arguments.sam});
    if (made.ok()) {
      result = *std::move(made);
    } else {
      result.status = made.status();
      result.damaged = std::move(damaged);
    }
  }
  if (!result.status.ok()) spdlog::error("{}", result.status.ToString());
  const absl::Status told = folder.WriteResult(spec.fence, result);
  if (told.ok()) return ExitOf(result.status);
  spdlog::error("{}", told.ToString());
  return WorkerExit::kFailed;
}

// The job's trace goes on in its log, and in the programs that it runs.
void FollowTrace(const JobSpec& spec, LogFormat format) {
  LogFields fields;
  fields.job = spec.job;
  if (const auto trace = ParseTraceparent(spec.traceparent)) {
    fields.trace_id = trace->trace_id;
    setenv("TRACEPARENT", ChildOf(*trace).ToString().c_str(), /*overwrite=*/1);
  }
  ConfigureLog(format, fields);
}

// Slurm starts a worker again whose node was lost: that is an attempt of its own, since the one
// before may still write.
absl::Status TakeFenceAfterRestart(const std::string& database, const JobFolder& folder,
                                   JobSpec& spec) {
  const char* restarts = std::getenv("SLURM_RESTART_COUNT");
  const char* number = std::getenv("SLURM_JOB_ID");
  if (number == nullptr) return absl::OkStatus();
  if (restarts == nullptr || std::strcmp(restarts, "0") == 0) return absl::OkStatus();
  ASSIGN_OR_RETURN(const std::unique_ptr<Store> store, Store::Open(database));
  ASSIGN_OR_RETURN(spec.fence, store->TakeNextFence(spec.job, absl::StrCat("slurm:", number)));
  spdlog::info("started again by Slurm: attempt {}", spec.fence);
  return folder.WriteSpec(spec);
}

// What a worker of Slurm's does before anything else: it asks the database for its attempt, and
// starts anew as a process whose memory, arguments and environment have never had the way to it.
// Returns only an error.
absl::Status BeginAnew(const Arguments& arguments, char** argv) {
  const std::string database = std::getenv(kSlurmDatabase);
  const JobFolder folder(arguments.folder);
  ASSIGN_OR_RETURN(JobSpec spec,
                   folder.ReadSpec(arguments.fence > 0 ? arguments.fence : folder.NewestFence()));
  FollowTrace(spec, arguments.log_format);
  RETURN_IF_ERROR(TakeFenceAfterRestart(database, folder, spec));
  std::vector<std::string> words, variables = JobEnvironment(arguments.environment);
  for (char** word = argv; *word != nullptr; ++word) {
    if (!std::string(*word).starts_with("--fence=")) words.emplace_back(*word);
  }
  words.push_back(absl::StrCat("--fence=", spec.fence));
  execve("/proc/self/exe", Pointers(words).data(), Pointers(variables).data());
  return FileError(words[0], "start again", errno);
}

// An empty folder for temporary files, of this attempt alone: what others keep in /tmp is theirs.
absl::Status MakeTemporaryFolder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::remove_all(folder, error);
  if (!error) std::filesystem::create_directories(folder, error);
  if (!error) std::filesystem::permissions(folder, std::filesystem::perms::owner_all, error);
  if (error) return FileError(folder, "make", error.value());
  setenv("TMPDIR", folder.c_str(), /*overwrite=*/1);
  return absl::OkStatus();
}

// The bytes of the dataset one by one, not the folders in which other projects' are, too.
SandboxNeeds NeedsOf(const JobSpec& spec, const JobFolder& folder, const Arguments& arguments) {
  SandboxNeeds needs;
  needs.writes = {folder.work()};
  for (const JobSpecFile& file : spec.files) needs.reads.emplace_back(file.path);
  if (!arguments.lpips_weights.empty()) needs.reads.emplace_back(arguments.lpips_weights);
  if (!arguments.sam.empty()) needs.reads.emplace_back(arguments.sam);
  needs.runs_programs = RunsPrograms(spec, arguments.priors);
  needs.programs = {arguments.priors.program};
  const auto colmap = FindProgram(arguments.colmap);
  if (colmap.ok()) needs.programs.push_back(*colmap);
  for (const std::string& path : arguments.sandbox_reads) needs.programs.emplace_back(path);
  needs.has_device = spec.device != "cpu";
  return needs;
}

WorkerExit DecodePhotograph(const Arguments& arguments) {
  if (arguments.parent != 0 && !EndWithParent(arguments.parent).ok()) return WorkerExit::kCancelled;
  return RunPhotographTask(arguments.photograph, arguments.sandbox);
}

WorkerExit Run(const Arguments& arguments) {
  const JobFolder folder(arguments.folder);
  absl::StatusOr<JobSpec> spec =
      folder.ReadSpec(arguments.fence > 0 ? arguments.fence : folder.NewestFence());
  absl::Status ready = spec.status();
  if (ready.ok()) FollowTrace(*spec, arguments.log_format);
  if (ready.ok() && arguments.parent != 0) ready = EndWithParent(arguments.parent);
  if (ready.ok()) ready = LimitResources(spec->memory_limit, spec->num_threads);
  if (ready.ok()) YieldToServer();
  if (ready.ok()) ready = MakeTemporaryFolder(folder.temporary());
  // It continues after the server's events, which the sandbox does not let it read.
  EventLog log = absl::CancelledError("not opened");
  if (ready.ok()) log = EventLogWriter::Open(folder.events(), spec->fence, EventPart::kWorker);
  // Before the first byte of a dataset.
  if (ready.ok() && arguments.sandbox) ready = EnterSandbox(NeedsOf(*spec, folder, arguments));
  if (!ready.ok()) {
    spdlog::error("{}", ready.ToString());
    return WorkerExit::kBadSpec;
  }
  const WorkerPulse pulse(folder.pulse(spec->fence), folder.lease(spec->fence),
                          std::chrono::seconds(spec->lease_seconds),
                          [] { _exit(static_cast<int>(WorkerExit::kLeaseLost)); });
  return RunJob(folder, *spec, arguments, log);
}

}  // namespace
}  // namespace pepeseg

int main(int argc, char** argv) {
  pepeseg::Arguments arguments;
  const bool parsed = pepeseg::Parse(argc, argv, &arguments);
  pepeseg::ConfigureLog(arguments.log_format);
  if (!parsed) {
    spdlog::error("{}", pepeseg::kUsage);
    return static_cast<int>(pepeseg::WorkerExit::kBadSpec);
  }
  if (!arguments.photograph.empty()) {
    return static_cast<int>(pepeseg::DecodePhotograph(arguments));
  }
  if (std::getenv(pepeseg::kSlurmDatabase) != nullptr) {
    spdlog::error("{}", pepeseg::BeginAnew(arguments, argv).ToString());
    return static_cast<int>(pepeseg::WorkerExit::kBadSpec);
  }
  std::signal(SIGTERM, pepeseg::OnTerminate);
  return static_cast<int>(pepeseg::Run(arguments));
}
