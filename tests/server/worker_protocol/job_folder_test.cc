#include "server/worker_protocol/job_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

using ::testing::HasSubstr;

class JobFolderTest : public ::testing::Test {
 protected:
  JobFolderTest() : job_(folder_.path()) { EXPECT_OK(job_.Make()); }

  testing::TempFolder folder_;
  JobFolder job_;
};

TEST_F(JobFolderTest, ReadsASpecAsWritten) {
  JobSpec spec;
  spec.job = "j3";
  spec.fence = 2;
  spec.files = {{"images/ä \"quoted\".jpg", 1, "/blobs/ab", "ab"},
                {"sparse/0/images.bin", 2, "/b", ""}};
  spec.options.mutable_reconstruct()->set_seed(18446744073709551615u);
  (*spec.options.mutable_advanced())["reconstruct.mean_learning_rate"] = "1.6e-4";
  spec.device = "cuda:1";
  spec.num_threads = 4;
  spec.memory_limit = int64_t{1} << 40;
  spec.checkpoint_seconds = 7;
  spec.checkpoint_steps = 8;
  spec.worker = {.sandbox = false,
                 .sandbox_reads = {"/opt/weights", "/opt/a b"},
                 .pass_environment = {"HF_TOKEN"},
                 .colmap = "/opt/colmap",
                 .priors_command = "/opt/\"priors\"",
                 .priors_seconds = 9,
                 .sam = "/opt/sam",
                 .keep_embeddings = false,
                 .lpips_weights = "/opt/lpips.onnx",
                 .log_format = "json"};
  ASSERT_OK(job_.WriteSpec(spec));
  ASSERT_OK_AND_ASSIGN(const auto read, job_.ReadSpec(job_.NewestFence()));
  EXPECT_EQ(read.job, spec.job);
  EXPECT_EQ(read.fence, spec.fence);
  EXPECT_EQ(read.device, spec.device);
  EXPECT_EQ(read.checkpoint_seconds, 7);
  EXPECT_EQ(read.checkpoint_steps, 8);
  EXPECT_EQ(read.files.at(0).sha256, "ab");
  ASSERT_EQ(read.files.size(), 2u);
  EXPECT_EQ(read.files[0].name, spec.files[0].name);
  EXPECT_EQ(read.files[1].kind, 2);
  EXPECT_EQ(read.files[1].path, "/b");
  EXPECT_EQ(read.options.DebugString(), spec.options.DebugString());
  EXPECT_EQ(read.num_threads, 4);
  EXPECT_EQ(read.memory_limit, spec.memory_limit);
  EXPECT_EQ(read.worker, spec.worker);
}

TEST_F(JobFolderTest, ReadsAResultAsWritten) {
  JobResult result;
  result.status = absl::InvalidArgumentError("images/1.jpg: truncated");
  result.metrics = {{"psnr", 21.25}, {"ssim", std::nan("")}};
  result.num_gaussians = 12;
  result.num_bytes = 34;
  result.sources = {{"masks", "command \"x\""}, {"poses", "given"}};
  ASSERT_OK(job_.WriteResult(5, result));
  ASSERT_OK_AND_ASSIGN(const auto read, job_.ReadResult(5));
  EXPECT_EQ(read.status, result.status);
  EXPECT_THAT(read.metrics, ::testing::ElementsAre(::testing::Pair("psnr", 21.25)));
  EXPECT_EQ(read.num_gaussians, 12);
  EXPECT_EQ(read.num_bytes, 34);
  EXPECT_EQ(read.sources, result.sources);
  EXPECT_EQ(job_.ReadResult(4).status().code(), absl::StatusCode::kNotFound);
}

TEST_F(JobFolderTest, ReportsABrokenSpecByName) {
  const std::string unknown_option =
      R"({"job":"j1","fence":1,"num_threads":1,"memory_limit":0,"files":[],"options":{"no":1}})";
  for (const std::string& text : {std::string(), std::string("[]"), std::string("{"),
                                  std::string(R"({"job": 3})"), unknown_option}) {
    std::ofstream(folder_.path() / "spec-1.json") << text;
    const auto status = job_.ReadSpec(job_.NewestFence()).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kDataLoss) << text;
    EXPECT_THAT(std::string(status.message()), HasSubstr("spec-1.json")) << text;
  }
}

TEST_F(JobFolderTest, CleansAndBoundsAWorkersResult) {
  JobResult result;
  result.status =
      absl::InternalError("\x1b]0;x\x07 /srv/data/pepeseg.db: " + std::string(100'000, 'x'));
  result.sources = {{"masks", "command\n" + std::string(1000, 'y')}};
  result.metrics = {{"a\x1b" + std::string(1000, 'z'), 1.0}};
  ASSERT_OK(job_.WriteResult(1, result));
  ASSERT_OK_AND_ASSIGN(const auto read, job_.ReadResult(1));
  const std::string message(read.status.message());
  EXPECT_EQ(message.size(), 2048u);
  EXPECT_THAT(message, ::testing::StartsWith("?]0;x? pepeseg.db: xxx"));
  EXPECT_EQ(read.sources.at("masks").size(), 256u);
  EXPECT_EQ(read.metrics.begin()->first.size(), 100u);
}

TEST_F(JobFolderTest, RefusesAResultThatIsNotARegularFile) {
  const std::filesystem::path place = job_.work() / "result-1.json";
  ASSERT_OK(job_.WriteResult(2, {}));
  std::filesystem::create_symlink("result-2.json", place);
  EXPECT_EQ(job_.ReadResult(1).status().code(), absl::StatusCode::kDataLoss);
  std::filesystem::remove(place);
  std::ofstream(place) << std::string(2 << 20, '[');
  EXPECT_EQ(job_.ReadResult(1).status().code(), absl::StatusCode::kDataLoss);
  std::ofstream(place) << std::string(1 << 19, '[');
  EXPECT_EQ(job_.ReadResult(1).status().code(), absl::StatusCode::kDataLoss);
}

class ModelOfAWorker : public JobFolderTest {
 protected:
  ModelOfAWorker() {
    std::filesystem::create_directories(job_.attempt(1));
    std::ofstream(job_.attempt(1) / "gaussians.ply") << "ply";
    std::ofstream(folder_ / "secret") << "secret";
  }
  void ExpectRefused() {
    const auto taken = job_.TakeModel(1);
    EXPECT_EQ(taken.status().code(), absl::StatusCode::kFailedPrecondition) << taken.status();
    EXPECT_FALSE(std::filesystem::exists(std::filesystem::symlink_status(job_.model(1))));
    EXPECT_TRUE(std::filesystem::exists(folder_ / "secret"));
  }
};

TEST_F(ModelOfAWorker, IsMovedOutOfItsReach) {
  EXPECT_EQ(job_.TakeModel(1).value_or(-1), 3);
  EXPECT_TRUE(std::filesystem::exists(job_.model(1) / "gaussians.ply"));
  EXPECT_FALSE(std::filesystem::exists(job_.attempt(1)));
  EXPECT_EQ(job_.TakeModel(1).value_or(-1), 3);  // the next server calls it again after a crash
  EXPECT_OK(CheckModelFolder(folder_.path(), "attempt-1"));
  EXPECT_EQ(job_.TakeModel(2).status().code(), absl::StatusCode::kNotFound);
}

TEST_F(ModelOfAWorker, IsRefusedWithALinkInIt) {
  std::filesystem::create_symlink(folder_ / "secret", job_.attempt(1) / "model.json");
  ExpectRefused();
}

TEST_F(ModelOfAWorker, IsRefusedWithAHardLinkInIt) {
  std::filesystem::create_hard_link(folder_ / "secret", job_.attempt(1) / "model.json");
  ExpectRefused();
}

TEST_F(ModelOfAWorker, IsRefusedAsALink) {
  std::filesystem::rename(job_.attempt(1), folder_ / "elsewhere");
  std::filesystem::create_directory_symlink(folder_ / "elsewhere", job_.attempt(1));
  ExpectRefused();
  EXPECT_TRUE(std::filesystem::exists(folder_ / "elsewhere/gaussians.ply"));
}

// Such a model may be from a version that did not check models when it took them.
TEST_F(ModelOfAWorker, IsNotLoadedWithALinkInIt) {
  std::filesystem::create_directories(folder_ / "jobs/j1/attempt-1");
  EXPECT_OK(CheckModelFolder(folder_.path(), "jobs/j1/attempt-1"));
  std::filesystem::create_symlink(folder_ / "secret", folder_ / "jobs/j1/attempt-1/model.json");
  EXPECT_EQ(CheckModelFolder(folder_.path(), "jobs/j1/attempt-1").code(),
            absl::StatusCode::kDataLoss);
}

TEST_F(JobFolderTest, RemovesWorkingFilesWithoutFollowingLinks) {
  const testing::TempFolder other;
  std::ofstream(other / "file") << "kept";
  for (const char* folder :
       {"attempt-1", "attempt-2", "work/attempt-2", "work/tmp", "work/a.log"}) {
    std::filesystem::create_directories(folder_ / folder);
  }
  for (const char* file : {"events.log", "spec-1.json", "slurm.sh", "work/events-1.log",
                           "work/result-1.json", "work/pulse-1"}) {
    std::ofstream(folder_ / file) << "x";
  }
  std::filesystem::create_directory_symlink(other.path(), job_.work() / "attempt-3");
  std::filesystem::create_symlink(other / "file", job_.work() / "b.log");
  job_.RemoveWorkingFiles("attempt-1");
  std::vector<std::string> left;
  for (const auto& entry : std::filesystem::directory_iterator(job_.work())) {
    left.push_back(entry.path().filename());
  }
  EXPECT_THAT(left, ::testing::UnorderedElementsAre("events-1.log", "result-1.json"));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "attempt-1"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "attempt-2"));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "events.log"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "slurm.sh"));
  EXPECT_TRUE(std::filesystem::exists(other / "file"));
}

TEST_F(JobFolderTest, LooksForCheckpointsInRealFoldersOnly) {
  const testing::TempFolder other;
  std::filesystem::create_directories(other / "checkpoints");
  std::ofstream(other / "checkpoints/a.ckpt") << "x";
  std::filesystem::create_directory_symlink(other.path(), job_.attempt(1));
  EXPECT_FALSE(job_.HasSaved(1));
  std::filesystem::create_directories(job_.checkpoints(2));
  EXPECT_FALSE(job_.HasSaved(2));
  std::ofstream(job_.checkpoints(2) / "a.ckpt") << "x";
  EXPECT_TRUE(job_.HasSaved(2));
}

}  // namespace
}  // namespace pepeseg
