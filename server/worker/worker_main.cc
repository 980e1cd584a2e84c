// pepeseg-worker: runs one job in its own process, so that a crash, or a file that was made to
// cause one, ends the job and never the service. The supervisor starts it. Started by hand, without
// --parent, it runs the job of a folder to its end. Everything else is in the job's spec. With
// --photograph it decodes one photograph instead (photograph_task.h), and with --text it runs the
// operator's program for a text (text_task.h).
//
// Threads: the main thread trains and handles SIGTERM; one thread writes the heartbeat; the backend
// has threads of its own. The sandbox is entered before any of them starts.
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdio>
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
#include "core/base/errors.h"
#include "core/base/module.h"
#include "core/base/status_macros.h"
#include "server/api/convert.h"
#include "server/observe/log.h"
#include "server/store/store.h"
#include "server/worker/group_guard.h"
#include "server/worker/sandbox/worker_limits.h"
#include "server/worker/sandbox/worker_sandbox.h"
#include "server/worker/worker_job.h"
#include "server/worker/worker_photograph.h"
#include "server/worker/worker_text.h"
#include "server/worker_protocol/heartbeat.h"
#include "server/worker_protocol/job_isolation.h"

namespace pepeseg {
namespace {

// A global, since a signal handler has no other way to the job.
StopSwitch stop_switch;

void OnTerminate(int) {
  // A job that does not look at the switch has nothing to save: files without a manifest do not
  // count.
  // Only async-signal-safe calls are allowed here: _exit, and stores to the switch.
  if (!stop_switch.polled) _exit(static_cast<int>(WorkerExit::kCancelled));
  stop_switch.stop = true;
}

// The command line.
struct Arguments {
  std::string folder;      // the job's folder
  int64_t fence = 0;       // fence of the attempt; 0: the newest in the folder
  pid_t parent = 0;        // process with which the worker is killed; 0: none
  std::string photograph;  // a PhotographTask
  std::string text;        // a TextTask
  bool sandbox = true;     // whether --photograph enters the sandbox; for a job its spec says
};

constexpr char kUsage[] =
    "usage: pepeseg-worker --job=FOLDER [--fence=N] [--parent=PID]\n"
    "       pepeseg-worker --photograph=TASK [--parent=PID] [--sandbox=on|off] < IMAGE > ANSWER\n"
    "       pepeseg-worker --text=TASK";

// Sets `value` to the text after the prefix `name`. Returns false if the word is not that flag.
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
        TakeFlag(word, "--photograph=", &arguments->photograph) ||
        TakeFlag(word, "--text=", &arguments->text)) {
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
  return !arguments->folder.empty() + !arguments->photograph.empty() + !arguments->text.empty() ==
         1;
}

absl::StatusOr<JobSpec> ReadSpec(const JobFolder& folder, const Arguments& arguments) {
  return folder.ReadSpec(arguments.fence > 0 ? arguments.fence : folder.NewestFence());
}

// Runs the job, and turns a lack of memory into its result.
JobResult RunWithinMemory(const WorkerJob& job) {
  try {
    return RunWorkerJob(job);
  } catch (const std::bad_alloc&) {
    // The standard library throws it. Here the job can still report it.
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

// Runs the job and writes its result. An error of opening the log is the job's result, too.
WorkerExit RunJob(const JobFolder& folder, const JobSpec& spec, const EventLog& log) {
  JobResult result;
  result.status = log.status();
  if (log.ok()) result = RunWithinMemory({folder, spec, **log, stop_switch});
  if (!result.status.ok()) spdlog::error("{}", result.status.ToString());
  // The result is the last file that the worker writes: if it is there, everything that it names is
  // too.
  const absl::Status written = folder.WriteResult(spec.fence, result);
  if (written.ok()) return ExitOf(result.status);
  spdlog::error("{}", written.ToString());
  return WorkerExit::kFailed;
}

// Sets the log's format to the spec's, and continues the trace of the request that created the job,
// in the log and, by TRACEPARENT, in the programs that the job runs.
void ConfigureLogOf(const JobSpec& spec) {
  LogFields fields;
  fields.job = spec.job;
  if (const auto trace = ParseTraceparent(spec.traceparent)) {
    fields.trace_id = trace->trace_id;
    setenv("TRACEPARENT", ChildOf(*trace).ToString().c_str(), /*overwrite=*/1);
  }
  ConfigureLog(LogFormatOf(spec.worker.log_format).value_or(LogFormat::kText), fields);
}

// Takes a new fence from the database if Slurm has restarted this worker, and writes the spec of
// that fence. The worker before it may still write under the old one.
absl::Status TakeFenceAfterRestart(const std::string& database, const JobFolder& folder,
                                   JobSpec& spec) {
  // Both are set by Slurm in the job's environment. Without a restart the fence of the command line
  // is this worker's.
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

// Called first in a worker of Slurm's, which has the database's URL in its environment. Takes its
// fence from the database, and executes this program again without the URL, so that the process
// that decodes uploads never had it in its memory, arguments or environment. Returns only on an
// error.
absl::Status ExecWithoutDatabase(const Arguments& arguments, char** argv) {
  const std::string database = std::getenv(kSlurmDatabase);
  const JobFolder folder(arguments.folder);
  ASSIGN_OR_RETURN(JobSpec spec, ReadSpec(folder, arguments));
  ConfigureLogOf(spec);
  RETURN_IF_ERROR(TakeFenceAfterRestart(database, folder, spec));
  std::vector<std::string> words, variables = JobEnvironment(spec.worker.pass_environment);
  for (char** word = argv; *word != nullptr; ++word) {
    // The fence may be a new one.
    if (!std::string(*word).starts_with("--fence=")) words.emplace_back(*word);
  }
  words.push_back(absl::StrCat("--fence=", spec.fence));
  execve("/proc/self/exe", Pointers(words).data(), Pointers(variables).data());
  return FileError(words[0], "start again", errno);
}

// Makes an empty folder and sets TMPDIR to it. /tmp would have files of other processes.
absl::Status MakeTemporaryFolder(const std::filesystem::path& folder) {
  std::error_code error;
  // An earlier attempt of the job may have left files.
  std::filesystem::remove_all(folder, error);
  if (!error) std::filesystem::create_directories(folder, error);
  if (!error) std::filesystem::permissions(folder, std::filesystem::perms::owner_all, error);
  if (error) return FileError(folder, "make", error.value());
  setenv("TMPDIR", folder.c_str(), /*overwrite=*/1);
  return absl::OkStatus();
}

// Returns what the job may use. Names the dataset's files one by one, since their folders also have
// files of other projects.
SandboxNeeds NeedsOf(const JobFolder& folder, const JobSpec& spec) {
  SandboxNeeds needs;
  needs.writes = {folder.work()};
  for (const JobSpecFile& file : spec.files) needs.reads.emplace_back(file.path);
  const absl::StatusOr<TrainingSettings> settings = TrainingSettingsFromProto(spec.options);
  const absl::StatusOr<TrainingInputs> inputs = TrainingInputsOf(folder, spec);
  // A job with an invalid spec fails before it reads these files or starts a program.
  if (settings.ok() && inputs.ok()) {
    for (const auto& file : FilesOf(inputs->tools)) needs.reads.push_back(file);
    needs.reads.push_back(ModulePath("video"));
    needs.runs_programs = MayRunPrograms(*inputs, *settings);
  }
  const WorkerOptions& options = spec.worker;
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

// Runs a job. The order matters: limits come first, then what the sandbox would refuse, then the
// sandbox, and only then is the first byte of a dataset read.
WorkerExit Run(const Arguments& arguments) {
  const JobFolder folder(arguments.folder);
  absl::StatusOr<JobSpec> spec = ReadSpec(folder, arguments);
  absl::Status ready = spec.status();
  if (ready.ok()) ConfigureLogOf(*spec);
  if (ready.ok() && arguments.parent != 0) ready = EndWithParent(arguments.parent);
  if (ready.ok()) ready = LimitResources(spec->memory_limit, spec->num_threads);
  if (ready.ok()) YieldToServer();
  if (ready.ok()) ready = MakeTemporaryFolder(folder.temporary());
  // Opening the log reads the server's events, to continue their numbers; the sandbox refuses that.
  EventLog log = absl::CancelledError("not opened");
  if (ready.ok()) log = EventLogWriter::Open(folder.events(), spec->fence, EventPart::kWorker);
  SandboxNeeds needs;
  if (ready.ok()) needs = NeedsOf(folder, *spec);
  if (ready.ok() && needs.runs_programs) ready = GuardGroup();
  if (ready.ok() && spec->worker.sandbox) ready = EnterSandbox(needs);
  if (!ready.ok()) {
    spdlog::error("{}", ready.ToString());
    return WorkerExit::kBadSpec;
  }
  const WorkerHeartbeat heartbeat(folder.heartbeat(spec->fence), folder.lease(spec->fence),
                                  std::chrono::seconds(spec->lease_seconds),
                                  [] { _exit(static_cast<int>(WorkerExit::kLeaseLost)); });
  return RunJob(folder, *spec, log);
}

}  // namespace
}  // namespace pepeseg

int main(int argc, char** argv) {
  if (argc == 2 && std::strcmp(argv[1], "--help") == 0) {
    std::puts(pepeseg::kUsage);
    return EXIT_SUCCESS;
  }
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
  if (!arguments.text.empty()) return static_cast<int>(pepeseg::RunTextTask(arguments.text));
  if (std::getenv(pepeseg::kSlurmDatabase) != nullptr) {
    spdlog::error("{}", pepeseg::ExecWithoutDatabase(arguments, argv).ToString());
    return static_cast<int>(pepeseg::WorkerExit::kBadSpec);
  }
  std::signal(SIGTERM, pepeseg::OnTerminate);
  return static_cast<int>(pepeseg::Run(arguments));
}
