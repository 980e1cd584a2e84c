#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iostream>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "server/worker/sandbox/worker_sandbox.h"
#include "server/worker_protocol/job_isolation.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {

inline constexpr int kNotEntered = 255;

// Returns 0 if the call succeeded, else its errno.
inline int ErrorOf(long result) { return result >= 0 ? 0 : errno; }

inline bool HasLandlock() { return LandlockVersion() >= kLandlockRefer; }

class WorkerSandboxTest : public ::testing::Test {
 protected:
  WorkerSandboxTest() {
    needs_.writes = {folder_ / "job"};
    needs_.reads = {folder_ / "blobs/mine"};
    for (const char* folder : {"job", "blobs"}) {
      std::filesystem::create_directories(folder_ / folder);
    }
    for (const char* file : {"blobs/mine", "blobs/theirs", "pepeseg.db", "audit.log", "job/old"}) {
      std::ofstream(folder_ / file) << file;
    }
  }

  // Runs `act` in a process that has entered the sandbox, and returns the process's status as
  // waitpid reports it.
  int Try(const std::function<int()>& act) {
    const pid_t pid = fork();
    if (pid == 0) {
      const absl::Status entered = EnterSandbox(needs_);
      if (!entered.ok()) std::cerr << entered << std::endl;
      _exit(entered.ok() ? act() : kNotEntered);
    }
    int status = 0;
    EXPECT_EQ(waitpid(pid, &status, 0), pid);
    return status;
  }
  void ExpectRefused(const std::function<long()>& call, int error = EPERM) {
    const int status = Try([&] { return ErrorOf(call()); });
    EXPECT_TRUE(WIFEXITED(status)) << "signal " << WTERMSIG(status);
    EXPECT_EQ(WEXITSTATUS(status), error);
  }
  // Makes all calls in one process.
  void ExpectEachRefused(const std::vector<std::function<long()>>& calls) {
    const int status = Try([&] {
      for (size_t i = 0; i < calls.size(); ++i) {
        if (ErrorOf(calls[i]()) != EPERM) return static_cast<int>(i) + 1;
      }
      return 0;
    });
    EXPECT_EQ(status, 0) << "call " << WEXITSTATUS(status) << " of the list is not refused";
  }
  void ExpectAllowed(const std::function<long()>& call) { ExpectRefused(call, 0); }
  void ExpectKilled(const std::function<long()>& call) {
    const int status = Try([&] { return ErrorOf(call()); });
    EXPECT_TRUE(WIFSIGNALED(status)) << "exit code " << WEXITSTATUS(status);
    EXPECT_EQ(WTERMSIG(status), SIGSYS);
  }
  long Open(const std::string& name, int flags) const {
    return OpenPath((folder_ / name).string(), flags);
  }
  static long OpenPath(const std::string& path, int flags) {
    return open(path.c_str(), flags | O_CLOEXEC, 0600);
  }
  // Runs `test` for each kind of job.
  void ForEachKind(const std::function<void()>& test) {
    for (const bool programs : {false, true}) {
      for (const bool device : {false, true}) {
        SCOPED_TRACE(absl::StrCat("programs ", programs, ", device ", device));
        needs_.runs_programs = programs;
        needs_.has_device = device;
        test();
      }
    }
  }
  long Exec() const {
    const pid_t pid = fork();
    if (pid < 0) return -1;
    if (pid == 0) {
      execl("/bin/true", "true", nullptr);
      _exit(errno);
    }
    int status = 0;
    waitpid(pid, &status, 0);
    errno = WEXITSTATUS(status);
    return WIFEXITED(status) && errno == 0 ? 0 : -1;
  }

  testing::TempFolder folder_;
  SandboxNeeds needs_;
};

}  // namespace pepeseg
