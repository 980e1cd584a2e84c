#pragma once

#include <sys/types.h>

#include <csignal>
#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "server/jobs/launcher.h"

namespace pepeseg {

// Descriptors of the caller's that a child gets as its standard input and output. Under 0: an empty
// input, and the log.
struct StandardFiles {
  int input = -1;
  int output = -1;
};

// A child process, reaped by this object alone. A worker asks to be killed when the thread that
// launched it ends, so launch from one that lives as long as the workers.
class WorkerProcess final : public LaunchedWorker {
 public:
  // The child gets no descriptor but its log, its input and its output, default signal actions, and
  // a process group of its own (a terminal's Ctrl-C is for the server). `needs` are the machine's.
  static absl::StatusOr<std::unique_ptr<WorkerProcess>> Launch(const WorkerCommand& command,
                                                               const StandardFiles& files = {});
  // Kills it when it still runs.
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

// The end of a log, from a line's start where one is near; empty when there is none.
std::string ReadFileTail(const std::filesystem::path& path, size_t max_bytes);

}  // namespace pepeseg
