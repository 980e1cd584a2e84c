// Kills the worker (SIGKILL) at random moments of real trainings: three times in `make test`, fifty
// times with PEPESEG_STRESS=full.
#include <gtest/gtest.h>

#include <csignal>
#include <iostream>
#include <random>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/base/file_io.h"
#include "tests/server/pepesegd_process.h"
#include "tests/server/service_client.h"
#include "tests/system/stress/full_stress.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

using testing::PepesegdProcess;
using testing::ServiceClient;

v1::TrainingOptions Options() {
  v1::TrainingOptions options;
  options.mutable_import()->set_image_scale(0.25);
  options.mutable_reconstruct()->set_num_steps(1500);
  options.mutable_features()->set_num_steps(300);
  options.mutable_features()->set_num_pixels(300);
  options.mutable_features()->set_steps_per_chunk(50);
  return options;
}

class KillWorkerTest : public ::testing::Test {
 protected:
  KillWorkerTest()
      : server_(folder_ / "data", std::vector<std::string>{"--checkpoint-seconds=1"}),
        client_(server_.channel()) {}

  // Starts a training, and returns the name of the job.
  std::string Train(const std::string& scene) {
    EXPECT_OK(client_.CreateScene(scene));
    const auto dataset =
        client_.Upload(scene, testing::ReadDataset(PEPESEG_TEST_DATA "/apc_shelf"));
    EXPECT_OK(dataset);
    const auto job = client_.Train(scene, dataset.value_or(""), Options());
    EXPECT_OK(job);
    return job.ok() ? job->name() : "";
  }

  bool Ended(const std::string& job) {
    const auto found = client_.GetJob(job);
    return found.ok() && found->state() != v1::JOB_STATE_QUEUED &&
           found->state() != v1::JOB_STATE_RUNNING;
  }

  // Returns the bytes of all files of the model.
  std::string ModelBytes(const std::string& job) {
    const auto done = client_.WaitForJob(job);
    EXPECT_OK(done);
    EXPECT_EQ(done->state(), v1::JOB_STATE_SUCCEEDED) << done->error().message();
    const std::filesystem::path jobs = folder_ / "data" / job;
    std::string bytes;
    for (const auto& entry : std::filesystem::directory_iterator(jobs)) {
      if (!entry.path().filename().string().starts_with("attempt-")) continue;
      for (const char* name : {"gaussians.ply", "features.bin"}) {
        const auto file = ReadFile(entry.path() / name, name, int64_t{1} << 30);
        EXPECT_OK(file);
        bytes += file.value_or("");
      }
    }
    return bytes;
  }

  // Kills at random moments until the job has ended, at most the given number of times, and returns
  // the number of kills. The pauses are long enough that most attempts save something: three in a
  // row that do not fail the job.
  int KillUntilEnd(const std::string& job, int most, std::mt19937& random) {
    int num_kills = 0;
    const std::string word = absl::StrCat("--job=", (folder_ / "data" / job).string());
    while (!Ended(job)) {
      absl::SleepFor(absl::Milliseconds(std::uniform_int_distribution<int>(1800, 4500)(random)));
      const pid_t worker = testing::FindProcess(word);
      if (num_kills == most || worker == 0) continue;
      kill(worker, SIGKILL);
      ++num_kills;
    }
    return num_kills;
  }

  const testing::TempFolder folder_;
  PepesegdProcess server_;
  ServiceClient client_;
};

TEST_F(KillWorkerTest, ResumesTrainingToTheSameBytes) {
  const int wanted = testing::FullStress() ? 50 : 3;
  const std::string unbroken = ModelBytes(Train("unbroken"));
  ASSERT_FALSE(unbroken.empty());
  std::mt19937 random(7);
  int num_kills = 0;
  for (int i = 0; num_kills < wanted && i < 10 * wanted; ++i) {
    const std::string job = Train(absl::StrCat("broken", i));
    num_kills += KillUntilEnd(job, wanted - num_kills, random);
    EXPECT_TRUE(ModelBytes(job) == unbroken) << job << " is another model";
  }
  std::cout << num_kills << " kills\n";
  EXPECT_GE(num_kills, wanted);
}

}  // namespace
}  // namespace pepeseg
