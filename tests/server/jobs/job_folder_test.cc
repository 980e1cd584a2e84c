#include "server/jobs/job_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

using ::testing::HasSubstr;

class JobFolderTest : public ::testing::Test {
 protected:
  JobFolderTest() : job_(folder_.path()) {}

  testing::TempFolder folder_;
  JobFolder job_;
};

TEST_F(JobFolderTest, SpecComesBackAsWritten) {
  JobSpec spec;
  spec.job = "j3";
  spec.fence = 2;
  spec.files = {{"images/ä \"quoted\".jpg", 1, "/blobs/ab", "ab"},
                {"sparse/0/images.bin", 2, "/b", ""}};
  spec.options.mutable_reconstruct()->set_seed(18446744073709551615u);
  spec.options.mutable_reconstruct()->set_mean_learning_rate(1.6e-4f);
  spec.device = "cuda:1";
  spec.num_threads = 4;
  spec.memory_limit = int64_t{1} << 40;
  spec.checkpoint_seconds = 7;
  spec.checkpoint_steps = 8;
  ASSERT_TRUE(job_.WriteSpec(spec).ok());
  const auto read = job_.ReadSpec(job_.NewestFence());
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->job, spec.job);
  EXPECT_EQ(read->fence, spec.fence);
  EXPECT_EQ(read->device, spec.device);
  EXPECT_EQ(read->checkpoint_seconds, 7);
  EXPECT_EQ(read->checkpoint_steps, 8);
  EXPECT_EQ(read->files.at(0).sha256, "ab");
  ASSERT_EQ(read->files.size(), 2u);
  EXPECT_EQ(read->files[0].name, spec.files[0].name);
  EXPECT_EQ(read->files[1].kind, 2);
  EXPECT_EQ(read->files[1].path, "/b");
  EXPECT_EQ(read->options.SerializeAsString(), spec.options.SerializeAsString());
  EXPECT_EQ(read->num_threads, 4);
  EXPECT_EQ(read->memory_limit, spec.memory_limit);
}

TEST_F(JobFolderTest, ResultComesBackAsWritten) {
  JobResult result;
  result.status = absl::InvalidArgumentError("images/1.jpg: truncated");
  result.metrics = {{"psnr", 21.25}, {"ssim", std::nan("")}};
  result.num_gaussians = 12;
  result.num_bytes = 34;
  result.sources = {{"masks", "command \"x\""}, {"poses", "given"}};
  ASSERT_TRUE(job_.WriteResult(5, result).ok());
  const auto read = job_.ReadResult(5);
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->status, result.status);
  EXPECT_THAT(read->metrics, ::testing::ElementsAre(::testing::Pair("psnr", 21.25)));
  EXPECT_EQ(read->num_gaussians, 12);
  EXPECT_EQ(read->num_bytes, 34);
  EXPECT_EQ(read->sources, result.sources);
  EXPECT_EQ(job_.ReadResult(4).status().code(), absl::StatusCode::kNotFound);
}

TEST_F(JobFolderTest, BrokenSpecIsDataLossThatNamesTheFile) {
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

}  // namespace
}  // namespace pepeseg
