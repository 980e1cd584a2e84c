// pepeseg-worker: runs one job in a process of its own, so that a crash, or a file that was made to
// cause one, ends the job and never the service. The supervisor starts it; by hand, without
// --parent, it runs the job of a folder to its end. The job's spec says everything else. With
// --photograph it decodes one photograph instead (photograph_task.h).
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
#include "core/train/stage_plan.h"
#include "server/api/convert.h"
#include "server/observe/log.h"
#include "server/observe/trace_context.h"
#include "server/store/store.h"
#include "server/worker/sandbox/worker_limits.h"
#include "server/worker/sandbox/worker_sandbox.h"
#include "server/worker/worker_job.h"
#include "server/worker/worker_photograph.h"
#include "server/worker_protocol/job_environment.h"
#include "server/worker_protocol/pulse.h"

namespace pepeseg {
namespace {

// A global, as a signal handler has no other way to the job.
StopSwitch stop_switch;

void OnTerminate(int) {
  // While nobody polls there is nothing to save: a file counts only once its manifest is written.
  if (!stop_switch.polled) _exit(static_cast<int>(WorkerExit::kCancelled));
  stop_switch.stop = true;
}

// The command line: whose job, and what the launcher alone knows.
struct Arguments {
  std::string folder;      // the job's
  int64_t fence = 0;       // of the attempt; 0: the newest in the folder
  pid_t parent = 0;        // the worker is killed when this process ends; 0: it has none
  std::string photograph;  // FormatPhotographTask's
  bool sandbox = true;     // of --photograph; a job's spec says it for the job
};

constexpr char kUsage[] =
    "usage: pepeseg-worker --job=FOLDER [--fence=N] [--parent=PID]\n"
    "       pepeseg-worker --photograph=TASK [--parent=PID] [--sandbox=on|off] < IMAGE > ANSWER";

// Takes the text after "--NAME=". False: the word is not that flag.
bool TakeFlag(const std::string& word, const char* name, std::string* value) {
  if (!word.starts_with(name)) return false;
  *value = word.substr(std::strlen(name));
  return true;
}

bool Parse(int argc, char** argv, Arguments* arguments) {
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    std::string text;
    if (TakeFlag(word, "--job=", &arguments->folder) ||
        TakeFlag(word, "--photograph=", &arguments->photograph)) {
      continue;
    }
    if (TakeFlag(word, "--sandbox=", &text)) {
      if (text != "on" && text != "off") return false;
      arguments->sandbox = text == "on";
    } else if (TakeFlag(word, "--fence=", &text)) {
      if (!absl::SimpleAtoi(text, &arguments->fence) || arguments->fence < 1) return false;
    } else if (!TakeFlag(word, "--parent=", &text) || !absl::SimpleAtoi(text, &arguments->parent)) {
      return false;
    }
  }
  return arguments->folder.empty() != arguments->photograph.empty();
}

absl::StatusOr<JobSpec> ReadSpec(const JobFolder& folder, const Arguments& arguments) {
  return folder.ReadSpec(arguments.fence > 0 ? arguments.fence : folder.NewestFence());
}

JobResult RunWithinMemory(const WorkerJob& job) {
  try {
    return RunWorkerJob(job);
  } catch (const std::bad_alloc&) {
    // Thrown by the standard library, not by us; caught where the job can still report it.
    JobResult result;
    result.status = absl::ResourceExhaustedError(
        absl::StrCat("out of memory: the job may take ", MemoryLimit() >> 20,
                     " MiB; smaller images (image_scale) or fewer Gaussians take less"));
    return result;
  }
}

WorkerExit ExitOf(const absl::Status& status) {
  if (status.ok()) return WorkerExit::kSucceeded;
  return absl::IsCancelled(status) ? WorkerExit::kCancelled : WorkerExit::kFailed;
}

using EventLog = absl::StatusOr<std::unique_ptr<EventLogWriter>>;

WorkerExit RunJob(const JobFolder& folder, const JobSpec& spec, const EventLog& log) {
  JobResult result;
  result.status = log.status();
  if (log.ok()) result = RunWithinMemory({folder, spec, **log, stop_switch});
  if (!result.status.ok()) spdlog::error("{}", result.status.ToString());
  const absl::Status written = folder.WriteResult(spec.fence, result);
  if (written.ok()) return ExitOf(result.status);
  spdlog::error("{}", written.ToString());
  return WorkerExit::kFailed;
}

// Logs in the format that the spec asks for, as part of the trace of the call that made the job;
// so do the programs that the job runs.
void ConfigureLogOf(const JobSpec& spec) {
  LogFields fields;
  fields.job = spec.job;
  if (const auto trace = ParseTraceparent(spec.traceparent)) {
    fields.trace_id = trace->trace_id;
    setenv("TRACEPARENT", ChildOf(*trace).ToString().c_str(), /*overwrite=*/1);
  }
  ConfigureLog(LogFormatOf(spec.worker.log_format).value_or(LogFormat::kText), fields);
}

// Slurm restarts a worker whose node was lost. The restarted one takes a fence of its own, since
// the one before may still write.
absl::Status TakeFenceAfterRestart(const std::string& database, const JobFolder& folder,
                                   JobSpec& spec) {
  const char* restarts = std::getenv("SLURM_RESTART_COUNT");
  const char* number = std::getenv("SLURM_JOB_ID");
  if (number == nullptr) return absl::OkStatus();
  if (restarts == nullptr || std::strcmp(restarts, "0") == 0) return absl::OkStatus();
  ASSIGN_OR_RETURN(const std::unique_ptr<Store> store, Store::Open(database));
  ASSIGN_OR_RETURN(spec.fence,
                   store->queue().TakeNextFence(spec.job, absl::StrCat("slurm:", number)));
  spdlog::info("restarted by Slurm: attempt {}", spec.fence);
  return folder.WriteSpec(spec);
}

// What a worker of Slurm's does before anything else: it takes its fence from the database, and
// executes itself as a process whose memory, arguments and environment have never had the
// database's URL. Returns only an error.
absl::Status ExecWithoutDatabase(const Arguments& arguments, char** argv) {
  const std::string database = std::getenv(kSlurmDatabase);
  const JobFolder folder(arguments.folder);
  ASSIGN_OR_RETURN(JobSpec spec, ReadSpec(folder, arguments));
  ConfigureLogOf(spec);
  RETURN_IF_ERROR(TakeFenceAfterRestart(database, folder, spec));
  std::vector<std::string> words, variables = JobEnvironment(spec.worker.pass_environment);
  for (char** word = argv; *word != nullptr; ++word) {
    if (!std::string(*word).starts_with("--fence=")) words.emplace_back(*word);
  }
  words.push_back(absl::StrCat("--fence=", spec.fence));
  execve("/proc/self/exe", Pointers(words).data(), Pointers(variables).data());
  return FileError(words[0], "start again", errno);
}

// Makes an empty folder for the temporary files of this attempt alone: /tmp has other users'.
absl::Status MakeTemporaryFolder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::remove_all(folder, error);
  if (!error) std::filesystem::create_directories(folder, error);
  if (!error) std::filesystem::permissions(folder, std::filesystem::perms::owner_all, error);
  if (error) return FileError(folder, "make", error.value());
  setenv("TMPDIR", folder.c_str(), /*overwrite=*/1);
  return absl::OkStatus();
}

// Whether the job may start COLMAP or the priors command. One whose spec is not valid fails before
// it gets there.
bool MayRunPrograms(const JobFolder& folder, const JobSpec& spec) {
  const absl::StatusOr<TrainingSettings> settings = TrainingSettingsFromProto(spec.options);
  const absl::StatusOr<TrainingInputs> inputs = TrainingInputsOf(folder, spec);
  if (!settings.ok() || !inputs.ok()) return false;
  return RunsPrograms(FactsOf(*inputs, *settings, /*on_device=*/false), settings->priors);
}

// Allows the dataset's files one by one: their folders have files of other projects, too.
SandboxNeeds NeedsOf(const JobFolder& folder, const JobSpec& spec) {
  SandboxNeeds needs;
  needs.writes = {folder.work()};
  for (const JobSpecFile& file : spec.files) needs.reads.emplace_back(file.path);
  const WorkerOptions& options = spec.worker;
  if (!options.lpips_weights.empty()) needs.reads.push_back(options.lpips_weights);
  if (!options.sam.empty()) needs.reads.push_back(options.sam);
  needs.runs_programs = MayRunPrograms(folder, spec);
  needs.programs = {options.priors_command};
  const auto colmap = FindProgram(options.colmap);
  if (colmap.ok()) needs.programs.push_back(*colmap);
  for (const std::string& path : options.sandbox_reads) needs.programs.emplace_back(path);
  needs.has_device = spec.device != "cpu";
  return needs;
}

WorkerExit DecodePhotograph(const Arguments& arguments) {
  if (arguments.parent != 0 && !EndWithParent(arguments.parent).ok()) return WorkerExit::kCancelled;
  return RunPhotographTask(arguments.photograph, arguments.sandbox);
}

// The order matters: limits first, what the sandbox would refuse before it is entered, and the
// sandbox before the first byte of a dataset is read.
WorkerExit Run(const Arguments& arguments) {
  const JobFolder folder(arguments.folder);
  absl::StatusOr<JobSpec> spec = ReadSpec(folder, arguments);
  absl::Status ready = spec.status();
  if (ready.ok()) ConfigureLogOf(*spec);
  if (ready.ok() && arguments.parent != 0) ready = EndWithParent(arguments.parent);
  if (ready.ok()) ready = LimitResources(spec->memory_limit, spec->num_threads);
  if (ready.ok()) YieldToServer();
  if (ready.ok()) ready = MakeTemporaryFolder(folder.temporary());
  // Its numbers continue those of the server's events, which the sandbox does not let it read.
  EventLog log = absl::CancelledError("not opened");
  if (ready.ok()) log = EventLogWriter::Open(folder.events(), spec->fence, EventPart::kWorker);
  if (ready.ok() && spec->worker.sandbox) ready = EnterSandbox(NeedsOf(folder, *spec));
  if (!ready.ok()) {
    spdlog::error("{}", ready.ToString());
    return WorkerExit::kBadSpec;
  }
  const WorkerPulse pulse(folder.pulse(spec->fence), folder.lease(spec->fence),
                          std::chrono::seconds(spec->lease_seconds),
                          [] { _exit(static_cast<int>(WorkerExit::kLeaseLost)); });
  return RunJob(folder, *spec, log);
}

}  // namespace
}  // namespace pepeseg

int main(int argc, char** argv) {
  pepeseg::Arguments arguments;
  const bool parsed = pepeseg::Parse(argc, argv, &arguments);
  pepeseg::ConfigureLog(pepeseg::LogFormat::kText);  // until the spec is read
  if (!parsed) {
    spdlog::error("{}", pepeseg::kUsage);
    return static_cast<int>(pepeseg::WorkerExit::kBadSpec);
  }
  if (!arguments.photograph.empty()) {
    return static_cast<int>(pepeseg::DecodePhotograph(arguments));
  }
  if (std::getenv(pepeseg::kSlurmDatabase) != nullptr) {
    spdlog::error("{}", pepeseg::ExecWithoutDatabase(arguments, argv).ToString());
    return static_cast<int>(pepeseg::WorkerExit::kBadSpec);
  }
  std::signal(SIGTERM, pepeseg::OnTerminate);
  return static_cast<int>(pepeseg::Run(arguments));
}
