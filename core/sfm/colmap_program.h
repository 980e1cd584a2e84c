#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "core/base/child_process.h"

namespace pepeseg {

// Runs commands of the COLMAP program as child processes. Thread safe after Open.
class ColmapProgram {
 public:
  // Finds the program (`name` as for FindProgram) and asks it for its version. Output of all
  // commands is appended to `log`. FAILED_PRECONDITION, with what to do: it is not found, or is not
  // COLMAP.
  static absl::StatusOr<ColmapProgram> Open(const std::string& name,
                                            const std::filesystem::path& log);

  // Returns the version, such as "COLMAP 3.8".
  const std::string& version() const { return version_; }

  struct Command {
    std::string name;                    // "mapper"
    std::vector<std::string> arguments;  // "--option", "value", ...
    // Text of the last line of output when the command fails because it found no result, which is
    // not an error here. Empty: every failure is an error.
    std::string no_result;
  };
  // Runs a command until it ends. DEADLINE_EXCEEDED: it ran past `deadline`. INTERNAL, with its
  // last lines: it failed. Also returns the errors of `watch`, which stop it (see RunChild).
  absl::Status Run(const Command& command, absl::Time deadline, ChildWatchFn watch) const;

 private:
  ColmapProgram(std::filesystem::path program, std::filesystem::path log)
      : program_(std::move(program)), log_(std::move(log)) {}

  std::filesystem::path program_, log_;
  std::string version_;
};

}  // namespace pepeseg
