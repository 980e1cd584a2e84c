// The Slurm launcher: MakeSlurmLauncher of launcher.h.
//
// One thread asks squeue for all jobs, so that the load on Slurm does not grow with their number;
// SlurmWorker::Poll reads what it found. The submitted script sets the variables that are not
// exported from this process, and then execs the worker.

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <csignal>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "core/base/child_process.h"
#include "core/base/errors.h"
#include "core/base/file_io.h"
#include "core/base/status_macros.h"
#include "server/jobs/launcher.h"
#include "server/worker_protocol/job_isolation.h"

namespace pepeseg {
namespace {

constexpr char kLaunchPrefix[] = "slurm:";
// Time limit of one of Slurm's programs.
constexpr absl::Duration kAnswerLimit = absl::Seconds(10);
constexpr std::chrono::seconds kPollInterval{2};
// A job is over once Slurm has not listed it this many times in a row.
constexpr int kMaxMissed = 3;

// Runs one of Slurm's programs and returns its output, by lines. UNAVAILABLE: it failed.
absl::StatusOr<std::vector<std::string>> RunSlurm(const std::string& name,
                                                  std::vector<std::string> arguments) {
  ASSIGN_OR_RETURN(const std::filesystem::path program, FindProgram(name));
  ChildCommand command;
  command.program = program;
  command.arguments = std::move(arguments);
  command.log = "/dev/null";
  command.time_limit = kAnswerLimit;
  std::vector<std::string> answer;
  ASSIGN_OR_RETURN(const ChildEnd end, RunChild(command, [&](std::span<const std::string> lines) {
                     answer.insert(answer.end(), lines.begin(), lines.end());
                     return absl::OkStatus();
                   }));
  if (end.exit_code == 0 && end.signal == 0) return answer;
  return absl::UnavailableError(
      absl::StrCat(name, " ", Describe(end), ": ", absl::StrJoin(answer, "; ")));
}

// squeue's last report of a job.
struct QueueEntry {
  std::string state;  // "PENDING", "RUNNING" ...
  int missed = 0;     // number of lists in a row without the job
};

// Returns how a job with this Slurm state ended; nothing if the state is not final.
std::optional<WorkerEnd> EndOf(const std::string& state) {
  using Kind = WorkerEnd::Kind;
  if (state == "COMPLETED") return WorkerEnd{Kind::kExited, 0, 0, "ended"};
  if (state == "FAILED" || state == "CANCELLED") {
    // The state does not say whether the worker ended by itself. Its result does: it is written
    // last.
    return WorkerEnd{Kind::kUnknown, 1, 0, absl::StrCat("is ", state, ", says Slurm")};
  }
  for (const char* killed :
       {"TIMEOUT", "OUT_OF_MEMORY", "NODE_FAIL", "BOOT_FAIL", "DEADLINE", "PREEMPTED"}) {
    if (state == killed) {
      return WorkerEnd{Kind::kKilled, 0, 0, absl::StrCat("was ended by Slurm: ", state)};
    }
  }
  return std::nullopt;
}

// The states of the jobs that this server follows. A thread of its own asks squeue for them every
// kPollInterval, and holds no lock meanwhile. Thread safe.
class SlurmQueue {
 public:
  SlurmQueue() : thread_([this] { Run(); }) {}
  ~SlurmQueue() {
    {
      const std::lock_guard lock(mutex_);
      stopping_ = true;
    }
    stop_.notify_all();
    thread_.join();
  }
  SlurmQueue(const SlurmQueue&) = delete;
  SlurmQueue& operator=(const SlurmQueue&) = delete;

  // Adds a job, and removes it.
  void Follow(int64_t number) {
    const std::lock_guard lock(mutex_);
    entries_[number];
  }
  void Forget(int64_t number) {
    const std::lock_guard lock(mutex_);
    entries_.erase(number);
  }
  // Returns how a followed job ended; nothing if it has not, or is not followed.
  std::optional<WorkerEnd> FindEnd(int64_t number) {
    const std::lock_guard lock(mutex_);
    const auto found = entries_.find(number);
    if (found == entries_.end()) return std::nullopt;
    // Slurm forgets jobs some minutes after their end. Whether this one succeeded is in its result.
    if (found->second.missed >= kMaxMissed) {
      return WorkerEnd{WorkerEnd::Kind::kUnknown, 1, 0, "is no longer known to Slurm"};
    }
    return EndOf(found->second.state);
  }

 private:
  void Run() {
    std::unique_lock lock(mutex_);
    while (!stop_.wait_for(lock, kPollInterval, [this] { return stopping_; })) {
      if (entries_.empty()) continue;
      lock.unlock();
      const auto lines = RunSlurm("squeue", {"--noheader", "--states=all", "--format=%i %T"});
      if (!lines.ok()) spdlog::error("{}", lines.status().ToString());
      lock.lock();
      // A failed squeue says nothing about the jobs: none of them is counted as missed.
      if (lines.ok()) Take(*lines);
    }
  }

  // Records the states in squeue's lines, "NUMBER STATE", and counts the jobs that are not listed.
  void Take(const std::vector<std::string>& lines) {
    std::set<int64_t> listed;
    for (const std::string& line : lines) {
      const std::pair<std::string, std::string> words =
          absl::StrSplit(line, absl::MaxSplits(' ', 1));
      int64_t number = 0;
      if (!absl::SimpleAtoi(words.first, &number)) continue;
      const auto found = entries_.find(number);
      if (found == entries_.end()) continue;
      found->second = {words.second, 0};
      listed.insert(number);
    }
    for (auto& [number, entry] : entries_) {
      if (!listed.contains(number)) ++entry.missed;
    }
  }

  std::mutex mutex_;  // guards stopping_ and entries_
  std::condition_variable stop_;
  bool stopping_ = false;
  std::map<int64_t, QueueEntry> entries_;
  std::thread thread_;
};

class SlurmWorker final : public LaunchedWorker {
 public:
  SlurmWorker(std::shared_ptr<SlurmQueue> queue, int64_t number)
      : queue_(std::move(queue)), number_(number) {
    queue_->Follow(number_);
  }
  ~SlurmWorker() override { queue_->Forget(number_); }

  std::string launch() const override { return absl::StrCat(kLaunchPrefix, number_); }
  std::optional<WorkerEnd> Poll() override { return queue_->FindEnd(number_); }
  void Stop() override {
    // The loop calls this at every round until the worker has ended; one signal is enough.
    if (stopped_) return;
    stopped_ = true;
    // A job that still waits has no process to signal, and nothing to save: it is removed.
    Cancel({"--state=PENDING"});
    // To the script's process only, which has become the worker by exec: its children must not die
    // before it.
    Cancel({"--signal=TERM", "--batch"});
  }
  void Kill() override {
    if (killed_) return;
    killed_ = true;
    Cancel({});
  }

 private:
  void Cancel(std::vector<std::string> arguments) const {
    arguments.push_back(absl::StrCat(number_));
    const auto answer = RunSlurm("scancel", std::move(arguments));
    if (!answer.ok()) spdlog::error("slurm:{}: {}", number_, answer.status().ToString());
  }

  std::shared_ptr<SlurmQueue> queue_;
  const int64_t number_;
  bool stopped_ = false;
  bool killed_ = false;
};

// Quotes a word for a POSIX shell.
std::string Quote(const std::string& word) {
  return absl::StrCat("'", absl::StrJoin(absl::StrSplit(word, '\''), "'\\''"), "'");
}

class SlurmLauncher final : public Launcher {
 public:
  explicit SlurmLauncher(LaunchOptions options)
      : options_(std::move(options)), queue_(std::make_shared<SlurmQueue>()) {}

  absl::StatusOr<std::unique_ptr<LaunchedWorker>> Launch(const WorkerCommand& command) override {
    // The job's folder, next to the log: the nodes have it, too.
    const std::filesystem::path script = command.log.parent_path() / "slurm.sh";
    RETURN_IF_ERROR(WriteFileAtomically(script, Script(command)));
    // The script has the database's URL, perhaps with a password.
    std::error_code error;
    std::filesystem::permissions(script, std::filesystem::perms::owner_all, error);
    if (error) return FileError(script, "protect", error.value());
    std::vector<std::string> arguments = Flags(command);
    arguments.push_back(script.string());
    ASSIGN_OR_RETURN(const std::vector<std::string> answer,
                     RunSlurm("sbatch", std::move(arguments)));
    int64_t number = 0;  // "17" or "17;cluster"
    if (answer.empty() ||
        !absl::SimpleAtoi(std::vector<std::string>(absl::StrSplit(answer.back(), ';'))[0],
                          &number)) {
      return absl::InternalError(
          absl::StrCat("sbatch answered '", absl::StrJoin(answer, "; "), "', no number"));
    }
    spdlog::info("jobs/{}: is Slurm's job {}", command.job, number);
    return std::make_unique<SlurmWorker>(queue_, number);
  }

  absl::StatusOr<std::unique_ptr<LaunchedWorker>> Attach(const std::string& launch) override {
    int64_t number = 0;
    if (!launch.starts_with(kLaunchPrefix) ||
        !absl::SimpleAtoi(launch.substr(sizeof(kLaunchPrefix) - 1), &number)) {
      return absl::NotFoundError(absl::StrCat("'", launch, "' is run by another launcher"));
    }
    return std::make_unique<SlurmWorker>(queue_, number);
  }

 private:
  std::string Script(const WorkerCommand& command) const {
    std::string script = "#!/bin/sh\n";
    std::vector<std::string> variables = command.environment;
    if (!options_.database.empty()) {
      variables.push_back(absl::StrCat(kSlurmDatabase, "=", options_.database));
    }
    for (const std::string& variable : variables) {
      const std::pair<std::string, std::string> parts =
          absl::StrSplit(variable, absl::MaxSplits('=', 1));
      absl::StrAppend(&script, "export ", parts.first, "=", Quote(parts.second), "\n");
    }
    absl::StrAppend(&script, "exec ", Quote(command.program.string()));
    for (const std::string& argument : command.arguments) {
      absl::StrAppend(&script, " ", Quote(argument));
    }
    return script + "\n";
  }

  // Returns the names of this process's variables that Slurm exports to the job: those of workers,
  // and those that libpq reads, which the worker removes before the job starts.
  static std::string ExportedNames(const WorkerCommand& command) {
    std::vector<std::string> names = DatabaseVariables();
    for (const std::string& variable : JobEnvironment(command.pass_environment)) {
      names.push_back(variable.substr(0, variable.find('=')));
    }
    return names.empty() ? "NIL" : absl::StrJoin(names, ",");
  }

  std::vector<std::string> Flags(const WorkerCommand& command) const {
    // --requeue: Slurm starts the job again after a node has failed; the worker then takes a new
    // fence. --open-mode=append keeps the log of the run before.
    std::vector<std::string> flags = {"--parsable", "--requeue", "--open-mode=append",
                                      // SIGTERM a minute before a time limit or preemption.
                                      "--signal=B:TERM@60", "--input=none",
                                      absl::StrCat("--export=", ExportedNames(command)),
                                      absl::StrCat("--job-name=pepeseg-", command.job),
                                      absl::StrCat("--output=", command.log.string()),
                                      absl::StrCat("--chdir=", command.log.parent_path().string())};
    const WorkerNeeds& needs = command.needs;
    if (needs.num_threads > 0) flags.push_back(absl::StrCat("--cpus-per-task=", needs.num_threads));
    if (needs.memory_bytes > 0) {
      // Rounded up, as the time below: Slurm ends a job that exceeds either.
      flags.push_back(absl::StrCat("--mem=", (needs.memory_bytes >> 20) + 1, "M"));
    }
    if (needs.seconds > 0) flags.push_back(absl::StrCat("--time=", (needs.seconds + 59) / 60));
    if (!options_.slurm_partition.empty()) {
      flags.push_back(absl::StrCat("--partition=", options_.slurm_partition));
    }
    if (!options_.slurm_gres.empty()) flags.push_back(absl::StrCat("--gres=", options_.slurm_gres));
    return flags;
  }

  const LaunchOptions options_;
  const std::shared_ptr<SlurmQueue> queue_;
};

}  // namespace

std::unique_ptr<Launcher> MakeSlurmLauncher(const LaunchOptions& options) {
  return std::make_unique<SlurmLauncher>(options);
}

}  // namespace pepeseg
