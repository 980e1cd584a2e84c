#pragma once

#include <sys/types.h>

#include <csignal>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"

namespace pepeseg {

// How a server starts the workers of its jobs, and how it paces their attempts.
struct LaunchOptions {
  enum class Launcher { kProcess, kSlurm };
  Launcher launcher = Launcher::kProcess;
  std::string slurm_partition;  // partition of the jobs; empty: Slurm's default
  std::string slurm_gres;       // generic resources of each job, such as "gpu:1"; empty: none
  std::string slurm_device;     // device of the nodes, as OpenDevice takes it; empty: the server's
  // The database's URL, as Store::Open takes it. Workers that Slurm restarts take their next fence
  // there.
  std::string database;
  // Lease duration. A server that fails to renew within it loses its jobs to the next claimant. A
  // worker on this machine that gives no heartbeat for as long is killed.
  int lease_seconds = 30;
  // Pauses before the next attempt of a job after the first, second, third ... crash in a row that
  // made no progress; the last pause repeats. A crash after progress gets the first. Not empty.
  std::vector<absl::Duration> crash_pauses = {absl::Seconds(1), absl::Seconds(10),
                                              absl::Seconds(60)};
  // Longest time between two checkpoints of a job, seconds.
  int checkpoint_seconds = 60;
};

// How a worker ended.
struct WorkerEnd {
  enum class Kind {
    kExited,   // by itself, with `exit_code`
    kKilled,   // by a signal, a limit of the cluster, or with its machine
    kUnknown,  // it is gone, and the launcher does not know how: its result, if there is one, says
  };
  Kind kind = Kind::kExited;
  int exit_code = 0;
  int signal = 0;           // the signal that killed it; 0: none, or unknown
  std::string description;  // predicate of a message, such as "was killed by signal 9 (Killed)"
};

// A worker, on this machine or another. Not thread safe. Whether the worker ends with this object
// depends on the launcher.
class LaunchedWorker {
 public:
  virtual ~LaunchedWorker() = default;

  // Returns the id by which another server can Attach() to it after this one has ended. Empty: the
  // worker ends with this server.
  virtual std::string launch() const = 0;
  // Returns how it ended; nothing while it runs, or waits to run. Does not block.
  virtual std::optional<WorkerEnd> Poll() = 0;
  // Sends SIGTERM: the worker saves a checkpoint and ends.
  virtual void Stop() = 0;
  // Ends it at once. Poll() reports the end later.
  virtual void Kill() = 0;
};

// Resources that a worker needs, by the estimate of its job. In each field 0 is the launcher's
// default.
struct WorkerNeeds {
  int num_threads = 0;
  int64_t memory_bytes = 0;  // host memory
  int64_t seconds = 0;       // maximum run time
};

struct WorkerCommand {
  std::filesystem::path program;
  std::vector<std::string> arguments;
  std::filesystem::path log;  // standard output and error are appended to it
  // Variables as "NAME=VALUE". They override those of this process.
  std::vector<std::string> environment = {};
  bool inherits_environment = true;  // whether it also gets the other variables of this process
  // Names of variables of this process that a Launcher passes on in addition to JobEnvironment's.
  std::vector<std::string> pass_environment = {};
  std::string job = {};  // the job's id, for logs and the cluster's queue
  WorkerNeeds needs = {};
};

// Starts workers. Used by the supervisor's thread only.
class Launcher {
 public:
  virtual ~Launcher() = default;
  // Starts a worker, or queues it at the cluster.
  virtual absl::StatusOr<std::unique_ptr<LaunchedWorker>> Launch(const WorkerCommand& command) = 0;
  // Follows a worker that another server has launched, by its launch(). NOT_FOUND: another kind of
  // launcher has launched it.
  virtual absl::StatusOr<std::unique_ptr<LaunchedWorker>> Attach(const std::string& launch) = 0;
};

// Descriptors of the caller that become a child's standard input and output. A negative `input` is
// an empty input; a negative `output` is the log.
struct StandardFiles {
  int input = -1;
  int output = -1;
};

// A child process. Only this object may wait for it. A worker asks the kernel to kill it when the
// thread that launched it ends, so the launching thread must live as long as its workers.
class WorkerProcess final : public LaunchedWorker {
 public:
  // Starts a process. It inherits no descriptors but its log, input and output, has default signal
  // actions, and a process group of its own, so that Ctrl-C at a terminal reaches the server only.
  // Ignores `command.needs`.
  static absl::StatusOr<std::unique_ptr<WorkerProcess>> Launch(const WorkerCommand& command,
                                                               const StandardFiles& files = {});
  // Kills the process if it still runs.
  ~WorkerProcess() override;
  WorkerProcess(const WorkerProcess&) = delete;
  WorkerProcess& operator=(const WorkerProcess&) = delete;

  std::string launch() const override { return ""; }
  std::optional<WorkerEnd> Poll() override;
  void Stop() override { Signal(SIGTERM); }
  void Kill() override { Signal(SIGKILL); }
  // Sends a signal, unless the process has been reaped.
  void Signal(int signal) const;
  pid_t pid() const { return pid_; }

 private:
  explicit WorkerProcess(pid_t pid) : pid_(pid) {}

  pid_t pid_;
  std::optional<WorkerEnd> end_;
};

// Returns a launcher whose workers are WorkerProcesses, with the arguments and variables of a job.
std::unique_ptr<Launcher> MakeProcessLauncher();

// Returns a launcher whose workers are batch jobs of a Slurm cluster (slurm.cc). It runs sbatch,
// squeue and scancel, found in PATH. The workers outlive this process. When a node is lost, or has
// to run another job, Slurm restarts its worker. launch() is "slurm:NUMBER".
//
// Launch, Stop and Kill wait up to 10 s for Slurm's answer. A thread of the launcher asks for the
// state of all jobs every two seconds.
std::unique_ptr<Launcher> MakeSlurmLauncher(const LaunchOptions& options);

}  // namespace pepeseg
