// Kills the worker (SIGKILL) at random moments of real trainings: three times in `make test`, fifty
// times with PEPESEG_STRESS=full.
#include <gtest/gtest.h>

#include <csignal>
#include <filesystem>
#include <iostream>
#include <random>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/base/file_io.h"
#include "tests/server/pepesegd_process.h"
#include "tests/server/service_client.h"
#include "tests/testing/full_stress.h"
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
  (*options.mutable_advanced())["features.num_pixels"] = "300";
  (*options.mutable_advanced())["features.steps_per_chunk"] = "50";
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

  // Returns whether a checkpoint of the job was written since then.
  bool HasSavedSince(const std::string& job, std::filesystem::file_time_type since) {
    std::error_code vanished;  // the worker and the server move and delete files meanwhile
    using Iterator = std::filesystem::recursive_directory_iterator;
    for (Iterator it(folder_ / "data" / job, vanished), end; it != end; it.increment(vanished)) {
      if (it->path().extension() != ".ckpt") continue;
      const auto written = std::filesystem::last_write_time(it->path(), vanished);
      if (!vanished && written > since) return true;
    }
    return false;
  }

  // Kills at random moments until the job has ended, at most the given number of times, and returns
  // the number of kills. Three attempts in a row that save nothing would fail the job: on a slow
  // machine the third is left alone until it has saved something.
  int KillUntilEnd(const std::string& job, int most, std::mt19937& random) {
    int num_kills = 0, num_unsaved = 0;
    auto newest_kill = std::filesystem::file_time_type::clock::now();
    const std::string word = absl::StrCat("--job=", (folder_ / "data" / job).string());
    while (!Ended(job)) {
      absl::SleepFor(absl::Milliseconds(std::uniform_int_distribution<int>(1800, 4500)(random)));
      const bool saved = HasSavedSince(job, newest_kill);
      if (!saved && num_unsaved == 2) continue;
      const pid_t worker = testing::FindProcess(word);
      if (num_kills == most || worker == 0) continue;
      kill(worker, SIGKILL);
      ++num_kills;
      num_unsaved = saved ? 0 : num_unsaved + 1;
      newest_kill = std::filesystem::file_time_type::clock::now();
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
