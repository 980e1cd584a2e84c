#include "core/base/child_process.h"

#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <fstream>
#include <iterator>

#include "absl/time/clock.h"
#include "tests/testing/eventually.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"
#include "tests/testing/time_limit.h"

namespace pepeseg {
namespace {

class ChildProcess : public ::testing::Test {
 protected:
  ChildCommand Shell(const std::string& script) const {
    ChildCommand command;
    command.program = "/bin/sh";
    command.arguments = {"-c", script};
    command.log = folder_ / "log";
    return command;
  }
  absl::StatusOr<ChildEnd> Run(const ChildCommand& command) {
    return RunChild(command, [&](std::span<const std::string> lines) {
      lines_.insert(lines_.end(), lines.begin(), lines.end());
      return absl::OkStatus();
    });
  }
  std::string Log() const {
    std::ifstream log(folder_ / "log");
    return {std::istreambuf_iterator<char>(log), {}};
  }

  testing::TempFolder folder_;
  std::vector<std::string> lines_;
};

// Returns true if the process whose id is in the file still runs. A zombie does not count.
bool Runs(const std::filesystem::path& pid_file) {
  std::string pid, word, state;
  std::ifstream(pid_file) >> pid;
  EXPECT_FALSE(pid.empty());
  std::ifstream stat("/proc/" + pid + "/stat");
  stat >> word >> word >> state;
  return stat.good() && state != "Z";
}

TEST_F(ChildProcess, PassesOnAndLogsLinesOfBothOutputs) {
  ASSERT_OK_AND_ASSIGN(const ChildEnd end, Run(Shell("echo a; echo b >&2; printf c; exit 3")));
  EXPECT_EQ(Describe(end), "exited with code 3");
  EXPECT_THAT(lines_, ::testing::ElementsAre("a", "b", "c"));
  EXPECT_EQ(Log(), "a\nb\nc");
}

TEST_F(ChildProcess, LosesNoOutput) {
  ASSERT_OK(Run(Shell("i=0; while [ $i -lt 20000 ]; do echo line $i; i=$((i+1)); done")));
  ASSERT_EQ(lines_.size(), 20000u);
  EXPECT_EQ(lines_.back(), "line 19999");
}

TEST_F(ChildProcess, GetsTheEnvironmentAndAnEmptyInput) {
  ChildCommand command = Shell("cat; echo $PEPESEG_A $HOME");
  command.environment = {"PEPESEG_A=x", "HOME=/nowhere"};
  ASSERT_OK(Run(command));
  EXPECT_THAT(lines_, ::testing::ElementsAre("x /nowhere"));
}

TEST_F(ChildProcess, ReportsTheSignal) {
  ASSERT_OK_AND_ASSIGN(const ChildEnd end, Run(Shell("kill -9 $$")));
  EXPECT_EQ(Describe(end), "was killed by signal 9 (Killed)");
}

TEST_F(ChildProcess, IsKilledWithItsGroupWhenTheWatchFails) {
  const ChildCommand command =
      Shell("sleep 100 & echo $! > " + (folder_ / "pid").string() + "; echo up; wait");
  const absl::Time start = absl::Now();
  const auto end = RunChild(command, [](std::span<const std::string> lines) {
    return lines.empty() ? absl::OkStatus() : absl::CancelledError("enough");
  });
  EXPECT_STATUS(end, absl::StatusCode::kCancelled, "enough");
  EXPECT_LT(absl::Now() - start, testing::TimeLimit(absl::Seconds(1)));
  EXPECT_TRUE(testing::Eventually([&] { return !Runs(folder_ / "pid"); })) << "init reaps it";
}

TEST_F(ChildProcess, LeavesNoProcessOfItsGroup) {
  ASSERT_OK(Run(Shell("sleep 100 & echo $! > " + (folder_ / "pid").string())));
  EXPECT_TRUE(testing::Eventually([&] { return !Runs(folder_ / "pid"); }));
}

TEST_F(ChildProcess, IsWatchedWithoutOutput) {
  int calls = 0;
  ASSERT_OK(RunChild(Shell("exec >/dev/null 2>&1; sleep 0.5"), [&](std::span<const std::string>) {
    ++calls;
    return absl::OkStatus();
  }));
  EXPECT_GE(calls, 3);
}

TEST_F(ChildProcess, IsStoppedAtTheTimeLimit) {
  ChildCommand command = Shell("sleep 100");
  command.time_limit = absl::Milliseconds(200);
  EXPECT_STATUS(Run(command), absl::StatusCode::kDeadlineExceeded, "sh was stopped after 200ms");
}

TEST_F(ChildProcess, DiesWithItsParent) {
  const pid_t parent = fork();
  ASSERT_GE(parent, 0);
  if (parent == 0) {
    Run(Shell("echo $$ > " + (folder_ / "pid").string() + "; exec sleep 100")).IgnoreError();
    _exit(0);
  }
  ASSERT_TRUE(testing::Eventually([&] {
    std::string pid;
    return !!(std::ifstream(folder_ / "pid") >> pid);
  }));
  EXPECT_TRUE(testing::Eventually([&] { return Runs(folder_ / "pid"); }, absl::Seconds(1)));
  kill(parent, SIGKILL);
  EXPECT_TRUE(testing::Eventually([&] { return !Runs(folder_ / "pid"); }));
}

TEST_F(ChildProcess, FailsIfTheProgramCannotRun) {
  ChildCommand command = Shell("");
  command.program = folder_ / "none";
  EXPECT_STATUS(Run(command), absl::StatusCode::kNotFound, "none cannot be run: No such file");
}

TEST(FindProgram, SearchesThePath) {
  ASSERT_OK_AND_ASSIGN(const std::filesystem::path shell, FindProgram("sh"));
  EXPECT_EQ(shell.filename(), "sh");
  EXPECT_OK(FindProgram("/bin/sh"));
  EXPECT_STATUS(FindProgram("no-such-program"), absl::StatusCode::kNotFound, "no-such-program");
  EXPECT_STATUS(FindProgram("/etc/passwd"), absl::StatusCode::kNotFound, "/etc/passwd");
}

}  // namespace
}  // namespace pepeseg
