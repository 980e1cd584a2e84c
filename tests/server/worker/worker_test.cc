#include <algorithm>
#include <csignal>
#include <fstream>

#include "core/model_files/model_file.h"
#include "tests/server/worker/worker_fixture.h"
#include "tests/testing/eventually.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

bool HasProgress(const std::vector<v1::JobEvent>& events) {
  return std::any_of(events.begin(), events.end(),
                     [](const v1::JobEvent& event) { return event.has_progress(); });
}

TEST_F(WorkerTest, MakesAModelOfPhotographs) {
  ExpectExit(Run(), WorkerExit::kSucceeded);
  ASSERT_OK_AND_ASSIGN(const auto result, job_.ReadResult(1));
  EXPECT_OK(result.status);
  ASSERT_OK_AND_ASSIGN(const auto model, ReadModel(job_.attempt(1)));
  EXPECT_EQ(model.gaussians.count, result.num_gaussians);
  EXPECT_EQ(model.field.features.size(), static_cast<size_t>(model.gaussians.count) * 32);
  EXPECT_EQ(model.views.size(), 15u);
  EXPECT_GT(model.metrics.at("psnr"), 5);
  EXPECT_GT(model.metrics.at("seconds_reconstruct"), 0);
  EXPECT_GT(model.metrics.at("core_seconds_reconstruct"), 0);
  EXPECT_GT(model.metrics.at("num_masks"), 0);
  EXPECT_GT(model.metrics.at("mask_quality"), 0);
  EXPECT_LE(model.metrics.at("mask_quality"), 1);
  EXPECT_THAT(model.facts.at("device"), HasSubstr("cpu (2 threads"));
  EXPECT_THAT(model.facts.at("options"), HasSubstr("\"numSteps\":60"));
  EXPECT_FALSE(std::filesystem::exists(job_.reconstruction(1)));
}

TEST_F(WorkerTest, ReportsEveryStage) {
  ExpectExit(Run(), WorkerExit::kSucceeded);
  std::vector<v1::JobStage> stages;
  std::map<v1::JobStage, int64_t> last_steps;
  double psnr = 0;
  v1::JobStage stage_of_quality = v1::JOB_STAGE_UNSPECIFIED;
  for (const v1::JobEvent& event : Events()) {
    if (event.has_stage_started()) stages.push_back(event.stage_started().stage());
    if (event.has_progress()) last_steps[event.progress().stage()] = event.progress().step();
    if (event.has_stage_ended() && event.stage_ended().metrics().contains("psnr")) {
      psnr = event.stage_ended().metrics().at("psnr");
    }
    if (event.has_stage_ended() && event.stage_ended().metrics().contains("mask_quality")) {
      stage_of_quality = event.stage_ended().stage();
    }
  }
  EXPECT_THAT(stages,
              ::testing::ElementsAre(v1::JOB_STAGE_PREPARE, v1::JOB_STAGE_SFM, v1::JOB_STAGE_PRIORS,
                                     v1::JOB_STAGE_RECONSTRUCT, v1::JOB_STAGE_EVALUATE,
                                     v1::JOB_STAGE_FEATURES, v1::JOB_STAGE_INDEX));
  EXPECT_EQ(last_steps[v1::JOB_STAGE_RECONSTRUCT], 60);
  EXPECT_EQ(last_steps[v1::JOB_STAGE_FEATURES], 20);
  EXPECT_GT(psnr, 5);
  EXPECT_EQ(stage_of_quality, v1::JOB_STAGE_FEATURES);
}

TEST_F(WorkerTest, StopsAtTheNextStepOnSigterm) {
  spec_.options.mutable_reconstruct()->set_num_steps(1'000'000);
  const auto worker = Launch(getpid());
  ASSERT_TRUE(testing::Eventually([&] { return HasProgress(Events()); }));
  worker->Signal(SIGTERM);
  ExpectExit(WaitFor(*worker), WorkerExit::kCancelled);
  ASSERT_OK_AND_ASSIGN(const auto result, job_.ReadResult(1));
  EXPECT_EQ(result.status.code(), absl::StatusCode::kCancelled);
  EXPECT_THAT(std::string(result.status.message()), HasSubstr("stage reconstruct"));
  EXPECT_FALSE(std::filesystem::is_empty(job_.checkpoints(1)));
}

TEST_F(WorkerTest, ResumesAfterStageOneWithTheSameBytes) {
  ExpectExit(Run(), WorkerExit::kSucceeded);
  ASSERT_OK_AND_ASSIGN(const auto unbroken,
                       ReadFile(job_.attempt(1) / "gaussians.ply", "first", 1 << 30));
  // The state that an attempt leaves which was stopped during stage two.
  ASSERT_OK_AND_ASSIGN(const auto model, ReadModel(job_.attempt(1)));
  std::filesystem::remove_all(job_.attempt(1));
  std::filesystem::create_directories(job_.reconstruction(1));
  ASSERT_OK(WriteModel(job_.reconstruction(1), model));
  spec_.fence = 2;
  ExpectExit(Run(), WorkerExit::kSucceeded);
  EXPECT_THAT(ReadFileTail(job_.worker_log(), 100000), HasSubstr("was done by attempt-1"));
  EXPECT_EQ(ReadFile(job_.attempt(2) / "gaussians.ply", "second", 1 << 30).value_or(""), unbroken);
  EXPECT_FALSE(std::filesystem::exists(job_.attempt(1)));
}

TEST_F(WorkerTest, NamesATruncatedPhotograph) {
  const std::string name = "images/frame-000003.jpg";
  const std::string bytes = BytesOf(name);
  Replace(name, bytes.substr(0, bytes.size() / 2));
  ExpectBadFile(name);
}

TEST_F(WorkerTest, RefusesAFileWhoseStoredBytesAreDamagedAndReportsItsDigest) {
  const std::string name = "images/frame-000003.jpg";
  std::string bytes = BytesOf(name);
  const std::string digest = Sha256Hex(bytes);
  bytes[bytes.size() / 2] = static_cast<char>(bytes[bytes.size() / 2] ^ 1);
  Replace(name, bytes).sha256 = digest;
  ExpectExit(Run(), WorkerExit::kFailed);
  ASSERT_OK_AND_ASSIGN(const JobResult result, job_.ReadResult(1));
  EXPECT_EQ(result.status.code(), absl::StatusCode::kDataLoss);
  EXPECT_EQ(result.status.message(), name +
                                         ": its stored bytes are damaged; upload the same files "
                                         "again, then train again");
  EXPECT_EQ(result.damaged, std::vector<std::string>{digest});
  EXPECT_FALSE(std::filesystem::exists(job_.attempt(1)));
}

TEST_F(WorkerTest, ReportsAllFilesWhoseStoredBytesAreMissing) {
  WriteSpec();
  std::vector<std::string> digests;
  for (JobSpecFile& file : spec_.files) {
    if (file.kind != v1::FILE_KIND_POSES) continue;
    file.path = (folder_.path() / "no such blob").string();
    digests.push_back(file.sha256);
  }
  ASSERT_GE(digests.size(), 2u);
  ExpectExit(Run(), WorkerExit::kFailed);
  ASSERT_OK_AND_ASSIGN(const JobResult result, job_.ReadResult(1));
  EXPECT_EQ(result.status.code(), absl::StatusCode::kDataLoss);
  EXPECT_THAT(std::string(result.status.message()), HasSubstr("its stored bytes are gone"));
  EXPECT_THAT(std::string(result.status.message()), Not(HasSubstr("no such blob")));
  EXPECT_EQ(result.damaged, digests);
}

TEST_F(WorkerTest, NamesAFileThatIsNotAPhotograph) {
  Replace("images/frame-000003.jpg", "GIF89a no photograph");
  ExpectBadFile("images/frame-000003.jpg");
}

TEST_F(WorkerTest, ReportsALackOfMemory) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "sanitizers map more memory than any limit leaves";
#endif
  spec_.memory_limit = int64_t{400} << 20;
  // The photographs fit in memory; this number of Gaussians does not.
  std::erase_if(spec_.files, [](const JobSpecFile& file) {
    return file.name.find("points3D") != std::string::npos;
  });
  (*spec_.options.mutable_advanced())["reconstruct.num_random_points"] = "10000000";
  spec_.options.mutable_reconstruct()->set_max_gaussians(10'000'000);
  ExpectExit(Run(), WorkerExit::kFailed);
  ASSERT_OK_AND_ASSIGN(const auto result, job_.ReadResult(1));
  EXPECT_EQ(result.status.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_THAT(std::string(result.status.message()), HasSubstr("out of memory"));
}

TEST_F(WorkerTest, FailsOnAMissingDevice) {
  spec_.device = "cuda:1000";
  ExpectExit(Run(), WorkerExit::kFailed);
  ASSERT_OK_AND_ASSIGN(const auto result, job_.ReadResult(1));
  EXPECT_EQ(result.status.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(result.status.message()), HasSubstr("device cuda:1000: "));
}

TEST_F(WorkerTest, RefusesABrokenSpec) {
  const auto launch = [&] {
    auto worker = WorkerProcess::Launch(
        {PEPESEG_WORKER, {absl::StrCat("--job=", job_.path().string())}, job_.worker_log()});
    return WaitFor(**worker);
  };
  ExpectExit(launch(), WorkerExit::kBadSpec);  // there is no spec
  std::ofstream(job_.path() / "spec-1.json") << R"({"job": 3})";
  ExpectExit(launch(), WorkerExit::kBadSpec);
  EXPECT_THAT(ReadFileTail(job_.worker_log(), 2000), HasSubstr("spec-1.json"));
}

TEST_F(WorkerTest, DoesNotOutliveItsServer) {
  ExpectExit(WaitFor(*Launch(/*parent=*/1)), WorkerExit::kBadSpec);
  EXPECT_THAT(ReadFileTail(job_.worker_log(), 2000), HasSubstr("the server has ended"));
}

}  // namespace
}  // namespace pepeseg
