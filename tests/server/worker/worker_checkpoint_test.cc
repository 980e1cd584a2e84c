// A worker that is killed or stopped, and the attempt after it.
#include <sys/resource.h>

#include <algorithm>
#include <csignal>
#include <limits>
#include <utility>

#include "core/model_files/checkpoint.h"
#include "core/reconstruct/checkpoint.h"
#include "tests/server/worker/worker_fixture.h"
#include "tests/testing/eventually.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using ::testing::HasSubstr;
using Paths = std::vector<std::filesystem::path>;

class WorkerCheckpointTest : public WorkerTest {
 protected:
  WorkerCheckpointTest() {
    spec_.options.mutable_reconstruct()->set_num_steps(400);
    (*spec_.options.mutable_advanced())["reconstruct.densify_every"] = "50";
    spec_.checkpoint_steps = 10;
  }

  // Returns the checkpoints of a stage of attempt 1, by step.
  Paths Checkpoints(const std::string& stage = "reconstruct") {
    Paths paths;
    std::error_code error;
    for (const auto& entry : std::filesystem::directory_iterator(job_.checkpoints(1), error)) {
      const std::string name = entry.path().filename().string();
      if (name.starts_with(stage + "-") && name.ends_with(".ckpt")) paths.push_back(entry.path());
    }
    std::sort(paths.begin(), paths.end());
    return paths;
  }

  // Launches a worker at the lowest priority, so that this process wakes before the worker
  // continues, even on a busy machine. Threads that the worker starts later inherit the priority.
  std::unique_ptr<WorkerProcess> LaunchInBackground() {
    auto worker = Launch(getpid());
    EXPECT_EQ(setpriority(PRIO_PROCESS, static_cast<id_t>(worker->pid()), 19), 0);
    return worker;
  }

  // Runs attempt 1, and kills it once it has two checkpoints and has densified. Checkpoints are due
  // by time here, after each step: those by steps are limited by their cost, so that on a slow disk
  // a run would never have three.
  Paths RunAndKill(const std::string& stage = "reconstruct") {
    const int64_t seconds = std::exchange(spec_.checkpoint_seconds, 0);
    const auto worker = LaunchInBackground();
    spec_.checkpoint_seconds = seconds;
    EXPECT_TRUE(testing::Eventually([&] {
      const Paths there = Checkpoints(stage);
      return there.size() >= 2 && StepOf(there.front()) >= 60;
    }));
    worker->Signal(SIGKILL);
    EXPECT_EQ(WaitFor(*worker).signal, SIGKILL);
    Paths paths = Checkpoints(stage);
    // There are three between the writing of the newest and the removal of the oldest.
    EXPECT_GE(paths.size(), 2u);
    EXPECT_LE(paths.size(), 3u);
    return paths;
  }

  // Runs attempt `fence` to its end, and returns the bytes of a file of the model.
  std::string Finish(int64_t fence, const std::string& file = "gaussians.ply") {
    spec_.fence = fence;
    ExpectExit(Run(), WorkerExit::kSucceeded);
    return ReadFile(job_.attempt(fence) / file, file, 1 << 30).value_or("");
  }

  // Returns the step at which an attempt started: the one before its first report.
  int64_t FirstStepOf(int64_t fence) {
    int64_t prepares = 0;
    for (const v1::JobEvent& event : Events()) {
      if (event.has_stage_started() && event.stage_started().stage() == v1::JOB_STAGE_PREPARE)
        ++prepares;
      if (prepares == fence && event.has_progress()) return event.progress().step() - 1;
    }
    return -1;
  }

  std::vector<std::string> Warnings() {
    std::vector<std::string> warnings;
    for (const v1::JobEvent& event : Events()) {
      if (event.has_warning()) warnings.push_back(event.warning().message());
    }
    return warnings;
  }

  static int64_t StepOf(const std::filesystem::path& path) {
    const std::string name = path.filename().string();
    return std::stoll(name.substr(name.find('-') + 1));
  }

  // Returns the bytes of an attempt that was not interrupted.
  std::string Unbroken(const std::string& file = "gaussians.ply") {
    const JobFolder broken = job_;
    job_ = JobFolder(folder_.path() / "unbroken");
    std::filesystem::create_directories(job_.path());
    std::string bytes = Finish(1, file);
    job_ = broken;
    return bytes;
  }
};

TEST_F(WorkerCheckpointTest, ResumesWithTheSameBytesAfterAKill) {
  const std::string unbroken = Unbroken();
  const Paths paths = RunAndKill();
  ASSERT_GE(paths.size(), 2u);
  EXPECT_EQ(Finish(2), unbroken);
  EXPECT_EQ(FirstStepOf(2), StepOf(paths.back()));
  EXPECT_THAT(Warnings(), ::testing::IsEmpty());
  ASSERT_OK_AND_ASSIGN(const auto result, job_.ReadResult(2));
  EXPECT_EQ(result.metrics.at("resumed_from_step"), StepOf(paths.back()));
  for (const int64_t fence : {1, 2}) EXPECT_FALSE(std::filesystem::exists(job_.checkpoints(fence)));
}

TEST_F(WorkerCheckpointTest, ResumesWithTheSameBytesAfterAKillInStageTwo) {
  spec_.options.mutable_reconstruct()->set_num_steps(40);
  spec_.options.mutable_features()->set_num_steps(400);
  const std::string unbroken = Unbroken("features.bin");
  ASSERT_FALSE(unbroken.empty());
  const Paths paths = RunAndKill("features");
  ASSERT_GE(paths.size(), 2u);
  EXPECT_EQ(Finish(2, "features.bin"), unbroken);
  EXPECT_THAT(Warnings(), ::testing::IsEmpty());
  ASSERT_OK_AND_ASSIGN(const auto result, job_.ReadResult(2));
  EXPECT_EQ(result.metrics.at("features_resumed_from_step"), StepOf(paths.back()));
  EXPECT_EQ(result.metrics.count("resumed_from_step"), 0u);  // stage one was done
  for (const int64_t fence : {1, 2}) EXPECT_FALSE(std::filesystem::exists(job_.checkpoints(fence)));
}

TEST_F(WorkerCheckpointTest, LosesNoStepAfterAStop) {
  spec_.checkpoint_steps = 1'000'000;  // only the stop writes a checkpoint
  // Seconds of steps are left at the stop, on a busy machine, too.
  spec_.options.mutable_reconstruct()->set_num_steps(3000);
  const std::string unbroken = Unbroken();
  const auto worker = LaunchInBackground();
  ASSERT_TRUE(testing::Eventually([&] { return FirstStepOf(1) >= 0; }));
  worker->Signal(SIGTERM);
  ExpectExit(WaitFor(*worker), WorkerExit::kCancelled);
  const Paths paths = Checkpoints();
  ASSERT_EQ(paths.size(), 1u);
  ASSERT_OK_AND_ASSIGN(const auto result, job_.ReadResult(1));
  EXPECT_THAT(std::string(result.status.message()),
              HasSubstr(absl::StrCat("at step ", StepOf(paths[0]), " of 3000")));
  EXPECT_EQ(Finish(2), unbroken);
  EXPECT_EQ(FirstStepOf(2), StepOf(paths[0]));
}

TEST_F(WorkerCheckpointTest, FallsBackFromADamagedCheckpointToTheOneBefore) {
  const std::string unbroken = Unbroken();
  const Paths paths = RunAndKill();
  ASSERT_GE(paths.size(), 2u);
  std::filesystem::resize_file(paths.back(), std::filesystem::file_size(paths.back()) / 2);
  EXPECT_EQ(Finish(2), unbroken);
  EXPECT_EQ(FirstStepOf(2), StepOf(paths[paths.size() - 2]));
  const std::vector<std::string> warnings = Warnings();
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_THAT(warnings[0], HasSubstr("attempt-1/checkpoints/" + paths.back().filename().string()));
  EXPECT_THAT(warnings[0], HasSubstr("truncated"));
}

TEST_F(WorkerCheckpointTest, StartsFromStepZeroWithoutAGoodCheckpoint) {
  const std::string unbroken = Unbroken();
  const Paths paths = RunAndKill();
  ASSERT_GE(paths.size(), 2u);
  for (const std::filesystem::path& path : paths) {
    std::fstream file(path, std::ios::binary | std::ios::in | std::ios::out);
    file.seekp(static_cast<std::streamoff>(std::filesystem::file_size(path) / 2));
    file.put('\x55').put('\x55');
  }
  EXPECT_EQ(Finish(2), unbroken);
  EXPECT_EQ(FirstStepOf(2), 0);
  EXPECT_THAT(Warnings(), ::testing::Each(HasSubstr("checksum")));
  EXPECT_EQ(Warnings().size(), paths.size());
}

TEST_F(WorkerCheckpointTest, DoesNotResumeFromOtherOptionsOrFiles) {
  const Paths paths = RunAndKill();
  ASSERT_GE(paths.size(), 2u);
  ASSERT_EQ(spec_.files[0].kind, spec_.files[1].kind);
  spec_.files[0].path = spec_.files[1].path;
  spec_.files[0].sha256.clear();  // WriteSpec computes the other file's
  Finish(2);
  EXPECT_EQ(FirstStepOf(2), 0);
  EXPECT_EQ(Warnings().size(), paths.size());
  EXPECT_THAT(Warnings(), ::testing::Each(HasSubstr("other files or options")));
}

TEST_F(WorkerCheckpointTest, DoesNotResumeFromNan) {
  const Paths paths = RunAndKill();
  ASSERT_GE(paths.size(), 2u);
  for (const std::filesystem::path& path : paths) {
    ASSERT_OK_AND_ASSIGN(const auto file, ReadCheckpoint(path));
    ASSERT_OK_AND_ASSIGN(auto checkpoint, GaussianCheckpoint::Read(file.sections));
    checkpoint.gaussians.moment2[5] = std::numeric_limits<float>::quiet_NaN();
    const CheckpointHeader header = file.header;
    ASSERT_OK(WriteCheckpoint(path, header, SectionsOf(checkpoint)));
  }
  Finish(2);
  EXPECT_EQ(FirstStepOf(2), 0);
  EXPECT_THAT(Warnings(), ::testing::Each(HasSubstr("moment2[5] is nan")));
}

}  // namespace
}  // namespace pepeseg
