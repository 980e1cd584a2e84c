#pragma once

#include <sys/types.h>

#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/child_process.h"

namespace pepeseg {

// A child process, reaped by this object alone. Not thread safe. A worker asks to be killed when
// the thread that launched it ends, so launch from one that lives as long as the workers.
class WorkerProcess {
 public:
  struct Command {
    std::filesystem::path program;
    std::vector<std::string> arguments;
    std::filesystem::path log;  // standard output and error are appended to it
  };
  // The child gets no descriptor but these two and an empty input, default signal actions, and a
  // process group of its own (a terminal's Ctrl-C is for the server).
  static absl::StatusOr<std::unique_ptr<WorkerProcess>> Launch(const Command& command);
  // Kills it when it still runs.
  ~WorkerProcess();
  WorkerProcess(const WorkerProcess&) = delete;
  WorkerProcess& operator=(const WorkerProcess&) = delete;

  using End = ChildEnd;
  // How it ended; none: it still runs. Does not block.
  std::optional<End> Poll();
  void Signal(int signal) const;
  pid_t pid() const { return pid_; }

 private:
  explicit WorkerProcess(pid_t pid) : pid_(pid) {}

  pid_t pid_;
  std::optional<End> end_;
};

// The end of a log, from a line's start where one is near; empty when there is none.
std::string ReadFileTail(const std::filesystem::path& path, size_t max_bytes);

}  // namespace pepeseg
