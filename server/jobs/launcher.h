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
    kUnknown,  // it is gone, and nobody can say how: its result tells, if there is one
  };
  Kind kind = Kind::kExited;
  int exit_code = 0;
  int signal = 0;           // that killed it; 0: none is known
  std::string description;  // "was killed by signal 9 (Killed)"
};

// A worker, wherever it runs. Not thread safe. Destroyed, it leaves the worker as the launcher
// says.
class LaunchedWorker {
 public:
  virtual ~LaunchedWorker() = default;

  // What others can find it by after this server has gone; empty: it goes with the server.
  virtual std::string launch() const = 0;
  // How it ended; none: it still runs, or waits to. Does not block.
  virtual std::optional<WorkerEnd> Poll() = 0;
  // SIGTERM: it saves what it has and ends.
  virtual void Stop() = 0;
  virtual void Kill() = 0;
};

// What a worker needs of its machine, from the estimate of its job.
struct WorkerNeeds {
  int num_threads = 0;       // 0: the launcher's default
  int64_t memory_bytes = 0;  // of the host; 0: likewise
  int64_t seconds = 0;       // at most; 0: likewise
};

struct WorkerCommand {
  std::filesystem::path program;
  std::vector<std::string> arguments;
  std::filesystem::path log;                  // standard output and error are appended to it
  std::vector<std::string> environment = {};  // "NAME=VALUE", in place of this process's
  bool inherits_environment = true;           // false: `environment` is all that it gets
  std::string job = {};                       // its id, for those who look at a cluster's queue
  WorkerNeeds needs = {};
};

class Launcher {
 public:
  virtual ~Launcher() = default;
  virtual absl::StatusOr<std::unique_ptr<LaunchedWorker>> Launch(const WorkerCommand& command) = 0;
  // A worker that another server has launched, by its launch(). NOT_FOUND: this kind of launcher
  // did not make it.
  virtual absl::StatusOr<std::unique_ptr<LaunchedWorker>> Attach(const std::string& launch) = 0;
};

// Workers as children of this process, killed with it. They get JobEnvironment's variables.
std::unique_ptr<Launcher> MakeProcessLauncher(const LaunchOptions& options);

}  // namespace pepeseg
