#pragma once

#include <sys/types.h>

#include <csignal>
#include <memory>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "server/jobs/launcher.h"

namespace pepeseg {

// Descriptors of the caller that become a child's standard input and output. Negative: an empty
// input, and the log.
struct StandardFiles {
  int input = -1;
  int output = -1;
};

// A child process, reaped by this object alone. A worker has the kernel kill it when the thread
// that launched it ends: launch it from a thread that lives as long as the workers.
class WorkerProcess final : public LaunchedWorker {
 public:
  // The child gets only the descriptors of its log, input and output, default signal actions, and a
  // process group of its own (a terminal's Ctrl-C is for the server). `command.needs` is ignored.
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
  void Signal(int signal) const;
  pid_t pid() const { return pid_; }

 private:
  explicit WorkerProcess(pid_t pid) : pid_(pid) {}

  pid_t pid_;
  std::optional<WorkerEnd> end_;
};

}  // namespace pepeseg
