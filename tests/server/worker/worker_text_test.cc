// The worker that runs the operator's program for a text.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <span>
#include <string>

#include "core/base/child_process.h"
#include "core/base/file_io.h"
#include "server/worker_protocol/text_task.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class WorkerTextTest : public ::testing::Test {
 protected:
  WorkerTextTest() {
    task_.folder = folder_ / "run";
    task_.text = "the red cup";
    task_.time_limit = absl::Seconds(30);
    task_.num_threads = 1;
    task_.program = folder_ / "find";
    std::filesystem::create_directories(TextPhotos(task_.folder));
    std::filesystem::create_directories(TextAnswers(task_.folder));
    std::ofstream(TextPhotos(task_.folder) / "000001.png") << "a photograph";
    std::ofstream(folder_ / "secret") << "a secret";
  }

  // Runs a script as the program, and returns the worker's exit code.
  int Run(const std::string& script) {
    std::ofstream(task_.program) << "#!/bin/sh\n" << script;
    EXPECT_EQ(chmod(task_.program.c_str(), 0700), 0);
    ChildCommand command;
    command.program = PEPESEG_WORKER;
    command.arguments = {"--text=" + FormatTextTask(task_)};
    command.log = folder_ / "worker.log";
    command.environment = {"PEPESEG_TEST_SECRET=of the server"};
    const auto end =
        RunChild(command, [](std::span<const std::string>) { return absl::OkStatus(); });
    EXPECT_OK(end.status());
    return end.ok() ? end->exit_code : -1;
  }
  std::string Output() const { return ReadFileTail(TextLog(task_.folder), 10'000); }
  std::string Why() const { return ReadFileTail(folder_ / "worker.log", 10'000); }

  testing::TempFolder folder_;
  TextTask task_;
};

TEST_F(WorkerTextTest, StartsTheProgramWithTheTextAndFolders) {
  ASSERT_EQ(Run(R"(echo "$@"; cat "$2/000001.png" >"$6/000001.json"; echo "$TMPDIR")"), 0) << Why();
  EXPECT_THAT(Output(), AllOf(HasSubstr("--photos " + TextPhotos(task_.folder).string() +
                                        " --text the red cup --out "),
                              HasSubstr(TextAnswers(task_.folder).string() + "/tmp\n")));
  EXPECT_EQ(ReadFileTail(TextAnswers(task_.folder) / "000001.json", 100), "a photograph");
}

TEST_F(WorkerTextTest, KeepsTheProgramAwayFromOtherFilesAndTheEnvironment) {
  Run("cat '" + (folder_ / "secret").string() + "'; echo x >'" + (folder_ / "written").string() +
      "'; env");
  EXPECT_FALSE(std::filesystem::exists(folder_ / "written"));
  EXPECT_THAT(Output(), Not(HasSubstr("a secret")));
  EXPECT_THAT(Output(), Not(HasSubstr("of the server")));
  EXPECT_THAT(Output(), HasSubstr("PATH="));
}

TEST_F(WorkerTextTest, PassesOnWhatTheOperatorAllows) {
  task_.sandbox_reads = {folder_ / "secret"};
  task_.pass_environment = {"PEPESEG_TEST_SECRET"};
  EXPECT_EQ(Run("cat '" + (folder_ / "secret").string() + "'; env"), 0) << Why();
  EXPECT_THAT(Output(),
              AllOf(HasSubstr("a secret"), HasSubstr("PEPESEG_TEST_SECRET=of the server")));
}

TEST_F(WorkerTextTest, SaysHowTheProgramFailed) {
  EXPECT_NE(Run("echo no weights >&2; exit 3"), 0);
  EXPECT_EQ(Why(), "exited with code 3\n");
  EXPECT_EQ(Output(), "no weights\n");
  EXPECT_NE(Run("kill -SEGV $$"), 0);
  EXPECT_THAT(Why(), HasSubstr("was killed by signal 11"));
}

TEST_F(WorkerTextTest, StopsAProgramThatTakesTooLong) {
  task_.time_limit = absl::Milliseconds(200);
  EXPECT_NE(Run("sleep 60"), 0);
  EXPECT_THAT(Why(), HasSubstr("find was stopped after 200ms, its time limit"));
}

}  // namespace
}  // namespace pepeseg
