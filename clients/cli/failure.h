#pragma once

#include <string>

#include "absl/status/status.h"

namespace pepeseg::client::cli {

// What the program answers to its caller. The README and --help list them.
enum ExitCode : int {
  kSuccess = 0,
  kUnexpected = 1,     // a fault of the program or the server
  kUsage = 2,          // the command line is wrong
  kNotFound = 3,       // no such scene, job, view or local file
  kRefused = 4,        // a value or a file is malformed or out of range
  kNoServer = 5,       // no server answers, or it is stopping
  kNotNow = 6,         // exists already, a training is running, no model yet
  kJobFailed = 7,      //
  kJobCancelled = 8,   //
  kLimit = 9,          // a limit of the server is reached
  kNotPermitted = 10,  //
  kCorrupt = 11,       // bytes that fail their checksum
  kInterrupted = 130,  // Ctrl-C; a job goes on
};

absl::Status JobFailed(const std::string& message);
absl::Status JobCancelled(const std::string& message);

ExitCode ExitCodeOf(const absl::Status& status);

// One or two lines for a person: what is wrong, and what to do about it where that is known.
std::string Explain(const absl::Status& status, const std::string& server);

// {"error": {"code", "message", "exit_code", "reason", "field", ...}} for scripts.
std::string ExplainJson(const absl::Status& status);

}  // namespace pepeseg::client::cli
