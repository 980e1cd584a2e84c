#pragma once

#include <filesystem>
#include <string>

#include "absl/status/status.h"

// Exit codes of the program, and what it prints about a failure.
namespace pepeseg::client::cli {

// The README and --help list them.
enum ExitCode : int {
  kSuccess = 0,
  kUnexpected = 1,     // a fault of the program or the server
  kUsage = 2,          // the command line is wrong
  kNotFound = 3,       // no such scene, job, view or local file
  kRefused = 4,        // a value or a file is malformed or out of range
  kNoServer = 5,       // no server answers, or it is shutting down
  kNotNow = 6,         // the state forbids it: the name is taken, a training runs, no model yet
  kJobFailed = 7,      // the watched job failed
  kJobCancelled = 8,   // the watched job was cancelled
  kLimit = 9,          // a limit of the server is reached
  kNotPermitted = 10,  // no key, or one that does not permit this
  kCorrupt = 11,       // bytes fail their checksum
  kInterrupted = 130,  // Ctrl-C; a running job continues
};

// Return errors whose exit code is kJobFailed and kJobCancelled.
absl::Status JobFailed(const std::string& message);
absl::Status JobCancelled(const std::string& message);

// Returns the exit code for a status of the client library, of a local file, or of the two
// functions above.
ExitCode ExitCodeOf(const absl::Status& status);

// Returns one or two lines for a person: the error and, where that is known, its remedy. `server`
// is the address that the command was sent to.
std::string Explain(const absl::Status& status, const std::string& server);

// Returns {"error": {"code", "exit_code", "message", "reason", "field", ...}} for scripts, on one
// line.
std::string ExplainJson(const absl::Status& status);

// Returns the shell command that starts a server at address `server`: pepesegd in `folder` by its
// full path, or else the one in PATH. Returns "" if neither exists.
std::string StartCommand(const std::string& server, const std::filesystem::path& folder);

}  // namespace pepeseg::client::cli
