#pragma once

#include <sys/types.h>

#include <csignal>
#include <memory>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "server/jobs/launcher.h"

namespace pepeseg {

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

}  // namespace pepeseg
