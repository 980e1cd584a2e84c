#include "server/worker/group_guard.h"

#include <fcntl.h>
#include <linux/close_range.h>
#include <sys/prctl.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <system_error>

#include "absl/strings/str_cat.h"

namespace pepeseg {
namespace {

absl::Status GuardError(absl::string_view what) {
  return absl::InternalError(absl::StrCat("guard of the process group: ", what, ": ",
                                          std::generic_category().message(errno)));
}

// Waits until all writers of the pipe are closed, then kills the group. Keeps none of the worker's
// descriptors open, and ignores all signals.
[[noreturn]] void Guard(pid_t group, int reader) {
  prctl(PR_SET_NAME, "pepeseg-guard");
  sigset_t all;
  sigfillset(&all);
  sigprocmask(SIG_SETMASK, &all, nullptr);
  setpgid(0, 0);
  dup2(reader, STDIN_FILENO);
  close_range(STDIN_FILENO + 1, ~0U, 0);
  char byte = 0;
  while (read(STDIN_FILENO, &byte, 1) < 0 && errno == EINTR) {
  }
  kill(-group, SIGKILL);
  _exit(0);
}

}  // namespace

absl::Status GuardGroup() {
  // A leader of a session, as under a cluster's scheduler, is a leader of its group.
  if (getpgrp() != getpid() && setpgid(0, 0) != 0) return GuardError("setpgid");
  // Only this process has the writer: it is closed when a program is started, so the reader learns
  // that this process has ended. It stays open to the end of the process.
  std::array<int, 2> ends{};
  if (pipe2(ends.data(), O_CLOEXEC) != 0) return GuardError("pipe2");
  const pid_t group = getpid();
  const pid_t pid = fork();
  if (pid < 0) return GuardError("fork");
  if (pid == 0) Guard(group, ends[0]);
  close(ends[0]);
  return absl::OkStatus();
}

}  // namespace pepeseg
