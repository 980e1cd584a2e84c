#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "server/jobs/launch_options.h"

namespace pepeseg {

// How a worker ended.
struct WorkerEnd {
  enum class Kind {
    kExited,   // by itself, with `exit_code`
    kKilled,   // by a signal, a limit of the cluster, or with its machine
    kUnknown,  // it is gone, and the launcher does not know how; its result says, if there is one
  };
  Kind kind = Kind::kExited;
  int exit_code = 0;
  int signal = 0;           // that killed it; 0: none, or unknown
  std::string description;  // "was killed by signal 9 (Killed)"
};

// A worker, wherever it runs. Not thread safe. The launcher says whether the worker survives the
// object.
class LaunchedWorker {
 public:
  virtual ~LaunchedWorker() = default;

  // By which another server finds it after this one has ended; empty: it ends with this server.
  virtual std::string launch() const = 0;
  // How it ended; none: it still runs, or waits to run. Does not block.
  virtual std::optional<WorkerEnd> Poll() = 0;
  // Sends SIGTERM: the worker saves a checkpoint and ends.
  virtual void Stop() = 0;
  virtual void Kill() = 0;
};

// Resources that a worker needs, by the estimate of its job. 0: the launcher's default.
struct WorkerNeeds {
  int num_threads = 0;
  int64_t memory_bytes = 0;  // of the host
  int64_t seconds = 0;       // at most
};

struct WorkerCommand {
  std::filesystem::path program;
  std::vector<std::string> arguments;
  std::filesystem::path log;                  // standard output and error are appended to it
  std::vector<std::string> environment = {};  // "NAME=VALUE", in place of this process's
  bool inherits_environment = true;           // false: `environment` is all that it gets
  // Names of variables of this process that a Launcher passes on, besides JobEnvironment's.
  std::vector<std::string> pass_environment = {};
  std::string job = {};  // its id, for those who look at a cluster's queue
  WorkerNeeds needs = {};
};

class Launcher {
 public:
  virtual ~Launcher() = default;
  virtual absl::StatusOr<std::unique_ptr<LaunchedWorker>> Launch(const WorkerCommand& command) = 0;
  // Finds a worker that another server has launched, by its launch(). NOT_FOUND: another kind of
  // launcher launched it.
  virtual absl::StatusOr<std::unique_ptr<LaunchedWorker>> Attach(const std::string& launch) = 0;
};

// Workers as children of this process, killed with it.
std::unique_ptr<Launcher> MakeProcessLauncher();

}  // namespace pepeseg
