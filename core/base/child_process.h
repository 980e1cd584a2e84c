#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"

namespace pepeseg {

// How a process ended.
struct ChildEnd {
  int exit_code = 0;
  int signal = 0;  // that killed it; 0: it exited by itself
};

// "exited with code 3" or "was killed by signal 9 (Killed)".
std::string Describe(const ChildEnd& end);

// `words` as exec() takes them, null at the end. They must outlive the pointers.
std::vector<char*> Pointers(std::vector<std::string>& words);

// Where a program is: `name` itself where it has a slash, else the first of its name in the folders
// of PATH. NOT_FOUND: there is none that may be run.
absl::StatusOr<std::filesystem::path> FindProgram(const std::string& name);

// A program that a stage has run for it. It gets an empty input, no descriptor of ours but its
// output, a process group of its own, and the resource limits of this process.
struct ChildCommand {
  std::filesystem::path program;  // as FindProgram tells it
  std::vector<std::string> arguments;
  std::vector<std::string> environment;  // "NAME=VALUE", in place of this process's of that name
  std::filesystem::path log;             // its output and errors are appended, 16 MiB at most
  absl::Duration time_limit = absl::InfiniteDuration();
};

// Called with the lines that the program has written since, at least ten times a second, with none
// when there are none. An error returned kills the program.
using ChildWatchFn = absl::FunctionRef<absl::Status(std::span<const std::string> lines)>;

// Runs it to its end, whichever that is; nothing of its process group is left afterwards. It is
// killed when this thread ends, as when this process is killed: run it from one that lives on.
// An error of `watch` ends it and is answered; DEADLINE_EXCEEDED: over its time limit; NOT_FOUND,
// INTERNAL: it could not be started.
absl::StatusOr<ChildEnd> RunChild(const ChildCommand& command, ChildWatchFn watch);

}  // namespace pepeseg
