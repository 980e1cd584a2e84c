#include "server/jobs/launcher.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <fstream>

#include "core/base/file_io.h"
#include "tests/testing/eventually.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

using ::testing::HasSubstr;

class WorkerProcessTest : public ::testing::Test {
 protected:
  WorkerProcessTest() : log_(folder_.path() / "log") {}

  std::unique_ptr<WorkerProcess> Shell(const std::string& script) {
    auto process = WorkerProcess::Launch({"/bin/sh", {"-c", script}, log_});
    EXPECT_OK(process);
    return std::move(process).value();
  }

  WorkerEnd WaitFor(WorkerProcess& process) {
    std::optional<WorkerEnd> end;
    EXPECT_TRUE(testing::Eventually([&] { return (end = process.Poll()).has_value(); }));
    return end.value_or(WorkerEnd());
  }

  WorkerEnd Run(const std::string& script) { return WaitFor(*Shell(script)); }

  std::string Log() { return ReadFileTail(log_, 100000); }

  testing::TempFolder folder_;
  std::filesystem::path log_;
};

TEST_F(WorkerProcessTest, ReportsHowItEnded) {
  EXPECT_EQ(Run("exit 7").exit_code, 7);
  EXPECT_EQ(Run("exit 7").description, "exited with code 7");
  EXPECT_EQ(Run("kill -9 $$").signal, SIGKILL);
  EXPECT_EQ(Run("kill -9 $$").description, "was killed by signal 9 (Killed)");
}

TEST_F(WorkerProcessTest, AppendsBothOutputsToTheLog) {
  Run("echo one; echo two >&2");
  Run("echo three");
  EXPECT_EQ(Log(), "one\ntwo\nthree\n");
}

TEST_F(WorkerProcessTest, InheritsNoDescriptor) {
  // Without CLOEXEC, as a careless library opens files, and with a number that no shell uses
  // itself.
  const int opened = open("/dev/null", O_RDONLY);
  const int secret = fcntl(opened, F_DUPFD, 50);
  ASSERT_GE(secret, 50);
  const std::string path = "/proc/$$/fd/" + std::to_string(secret);
  Run("[ -e /proc/$$/fd/1 ] && [ ! -e " + path + " ] && echo clean; read line || echo no input");
  close(secret);
  close(opened);
  EXPECT_EQ(Log(), "clean\nno input\n");
}

TEST_F(WorkerProcessTest, HasItsOwnGroupAndDefaultSignals) {
  const auto before = std::signal(SIGTERM, SIG_IGN);
  const auto process = Shell("while true; do sleep 0.01; done");
  std::signal(SIGTERM, before);
  EXPECT_EQ(getpgid(process->pid()), process->pid());
  process->Signal(SIGTERM);
  EXPECT_EQ(WaitFor(*process).signal, SIGTERM);
  process->Signal(SIGTERM);  // it is reaped: no process gets the signal
}

TEST_F(WorkerProcessTest, IsKilledWithItsObject) {
  auto process = Shell("while true; do sleep 0.01; done");
  const pid_t pid = process->pid();
  EXPECT_FALSE(process->Poll().has_value());
  process.reset();
  EXPECT_EQ(kill(pid, 0), -1);
  EXPECT_EQ(errno, ESRCH);
}

TEST_F(WorkerProcessTest, TailOfALogStartsAtALine) {
  Run("echo first line; echo second line");
  EXPECT_EQ(ReadFileTail(log_, 15), "second line\n");
  EXPECT_EQ(ReadFileTail(log_, 100), "first line\nsecond line\n");
  EXPECT_EQ(ReadFileTail(folder_ / "none", 100), "");
}

TEST_F(WorkerProcessTest, NamesAMissingProgram) {
  const auto status = WorkerProcess::Launch({"/nowhere/at/all", {}, log_}).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(status.message()), HasSubstr("/nowhere/at/all"));
}

TEST_F(WorkerProcessTest, DoesNotPassSecretsOn) {
  for (const char* name : {"PEPESEG_KEY", "PGPASSWORD", "PGPASSFILE", "AWS_SECRET_ACCESS_KEY",
                           "SLURM_JWT", "OPERATORS_OWN", "CUDA_VISIBLE_DEVICES"}) {
    setenv(name, "value", 1);
  }
  const auto launcher = MakeProcessLauncher();
  std::ofstream(folder_ / "show.sh") << "tr '\\0' '\\n' < /proc/$$/environ";
  WorkerCommand command{"/bin/sh", {(folder_ / "show.sh").string()}, log_, {"TRACEPARENT=00"}};
  command.pass_environment = {"OPERATORS_OWN"};
  ASSERT_OK_AND_ASSIGN(const auto worker, launcher->Launch(command));
  EXPECT_TRUE(testing::Eventually([&] { return worker->Poll().has_value(); }));
  const std::string variables = Log();
  for (const char* secret : {"PEPESEG_KEY", "PGPASS", "AWS_", "SLURM_JWT"}) {
    EXPECT_THAT(variables, ::testing::Not(HasSubstr(secret)));
  }
  for (const char* passed :
       {"TRACEPARENT=00", "OPERATORS_OWN=value", "CUDA_VISIBLE_DEVICES=value", "PATH="}) {
    EXPECT_THAT(variables, HasSubstr(passed));
  }
  for (const char* name : {"PEPESEG_KEY", "PGPASSWORD", "PGPASSFILE", "AWS_SECRET_ACCESS_KEY",
                           "SLURM_JWT", "OPERATORS_OWN", "CUDA_VISIBLE_DEVICES"}) {
    unsetenv(name);
  }
}

}  // namespace
}  // namespace pepeseg
