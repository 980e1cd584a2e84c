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
  int signal = 0;  // the signal that killed it; 0: it exited by itself
};

// Returns "exited with code 3" or "was killed by signal 9 (Killed)".
std::string Describe(const ChildEnd& end);

// Returns pointers to the words as exec() expects them, with a null pointer at the end. `words`
// must outlive them.
std::vector<char*> Pointers(std::vector<std::string>& words);

// Returns the path of a program: `name` itself if it has a slash, else the first executable file of
// that name in the folders of PATH. Returns NOT_FOUND if there is none.
absl::StatusOr<std::filesystem::path> FindProgram(const std::string& name);

// A program to run as a child process. It gets an empty standard input, a pipe as standard output
// and standard error, no other descriptor of this process, its own process group, and the resource
// limits of this process.
struct ChildCommand {
  std::filesystem::path program;  // as FindProgram returns it
  std::vector<std::string> arguments;
  // "NAME=VALUE", added to the environment of this process; replaces a variable of the same name.
  std::vector<std::string> environment;
  std::filesystem::path log;  // its output is appended to this file, at most 16 MiB of it
  absl::Duration time_limit = absl::InfiniteDuration();
};

// Called about every 50 ms, and more often while the program writes, with the lines that it has
// written since the last call; possibly none. An error that it returns kills the program.
using ChildWatchFn = absl::FunctionRef<absl::Status(std::span<const std::string> lines)>;

// Runs a program until it ends and returns how it ended, whether well or not. Afterwards no process
// of its group is left. Calls `watch` on the calling thread.
//
// If this process is killed meanwhile, the kernel kills the program (PR_SET_PDEATHSIG). The
// processes that the program has started are not killed then. A process that cannot make process
// groups, such as a worker in its sandbox, keeps the program in its own group: of what the program
// has started, nothing is killed then.
//
// Returns the error of `watch` if it returned one, after killing the group. DEADLINE_EXCEEDED: the
// program ran for longer than its time limit. NOT_FOUND, INTERNAL: it could not be started.
absl::StatusOr<ChildEnd> RunChild(const ChildCommand& command, ChildWatchFn watch);

}  // namespace pepeseg
