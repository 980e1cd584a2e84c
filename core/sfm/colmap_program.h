#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "core/base/child_process.h"

namespace pepeseg {

// COLMAP's command line.
class ColmapProgram {
 public:
  // `name`: as FindProgram. FAILED_PRECONDITION: it is not there, or is another program.
  static absl::StatusOr<ColmapProgram> Open(const std::string& name,
                                            const std::filesystem::path& log);

  // "COLMAP 3.8".
  const std::string& version() const { return version_; }

  struct Command {
    std::string name;                    // "mapper"
    std::vector<std::string> arguments;  // "--option", "value", ...
    std::string no_result;  // what it says where there is no result, which is no failure; or empty
  };
  // Runs a command to its end. DEADLINE_EXCEEDED: past `deadline`; INTERNAL, with its last lines:
  // it failed; errors of `watch`.
  absl::Status Run(const Command& command, absl::Time deadline, ChildWatchFn watch) const;

 private:
  ColmapProgram(std::filesystem::path program, std::filesystem::path log)
      : program_(std::move(program)), log_(std::move(log)) {}

  std::filesystem::path program_, log_;
  std::string version_;
};

}  // namespace pepeseg
