// Files that no client should send, uploaded to the server program. Each fails the job with an
// error that names the file, leaves no part of a model, and the server still serves.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>

#include "tests/server/pepesegd_process.h"
#include "tests/server/service_client.h"
#include "tests/testing/png_bytes.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

using testing::ClientFile;
using testing::FileOf;
using ::testing::HasSubstr;
using testing::PepesegdProcess;
using testing::ServiceClient;

constexpr char kPhoto[] = "images/frame-000003.jpg";
constexpr char kPoses[] = "sparse/0/images.bin";

class BadInputTest : public ::testing::Test {
 protected:
  BadInputTest()
      : server_(folder_ / "data"),
        client_(server_.channel()),
        files_(testing::ReadDataset(PEPESEG_TEST_DATA "/apc_shelf")) {
    EXPECT_OK(client_.CreateScene("shelf"));
  }

  // The import finds the errors, so the later stages are short.
  static v1::TrainingOptions ShortestOptions() {
    v1::TrainingOptions options;
    options.mutable_import()->set_image_scale(0.125);
    options.mutable_reconstruct()->set_num_steps(5);
    options.mutable_features()->set_num_steps(5);
    (*options.mutable_advanced())["features.num_pixels"] = "50";
    return options;
  }

  v1::Job Train(const std::vector<ClientFile>& files) {
    const auto dataset = client_.Upload("shelf", files);
    EXPECT_OK(dataset);
    const auto job = client_.Train("shelf", dataset.value_or(""), ShortestOptions());
    EXPECT_OK(job);
    const auto ended = client_.WaitForJob(job.ok() ? job->name() : "");
    EXPECT_OK(ended);
    return ended.value_or(v1::Job());
  }

  void ExpectServing() {
    EXPECT_TRUE(server_.alive()) << server_.Log();
    const v1::Job job = Train(testing::ReadDataset(PEPESEG_TEST_DATA "/apc_shelf"));
    EXPECT_EQ(job.state(), v1::JOB_STATE_SUCCEEDED) << job.error().message();
  }

  // Trains `files_`, and expects the job to fail with an error that names the file.
  void ExpectBadFile(const std::string& name) {
    const v1::Job job = Train(files_);
    EXPECT_EQ(job.state(), v1::JOB_STATE_FAILED);
    EXPECT_EQ(job.error().code(), static_cast<int>(absl::StatusCode::kInvalidArgument));
    EXPECT_THAT(job.error().message(), HasSubstr(name));
    for (const auto& entry : std::filesystem::directory_iterator(folder_ / "data" / job.name())) {
      EXPECT_THAT(entry.path().filename().string(), ::testing::Not(HasSubstr("attempt")));
    }
    EXPECT_STATUS(client_.GetModel("scenes/shelf/models/live"),
                  absl::StatusCode::kFailedPrecondition, "no model");
    ExpectServing();
  }

  void ExpectUploadRefused(const std::string& words) {
    EXPECT_STATUS(client_.CreateUpload("shelf", files_), absl::StatusCode::kInvalidArgument, words);
    ExpectServing();
  }

  testing::TempFolder folder_;
  PepesegdProcess server_;
  ServiceClient client_;
  std::vector<ClientFile> files_;
};

TEST_F(BadInputTest, RefusesATruncatedJpeg) {
  std::string& bytes = FileOf(files_, kPhoto).bytes;
  bytes.resize(bytes.size() / 2);
  ExpectBadFile(kPhoto);
}

TEST_F(BadInputTest, RefusesPosesThatDeclareABillionImages) {
  const uint64_t count = 1'000'000'000;
  std::memcpy(FileOf(files_, kPoses).bytes.data(), &count, sizeof(count));
  ExpectBadFile(kPoses);
}

TEST_F(BadInputTest, RefusesAPoseWithNan) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  // The quaternion of the first image follows the number of images (u64) and that image's id (u32).
  std::memcpy(FileOf(files_, kPoses).bytes.data() + 12, &nan, sizeof(nan));
  ExpectBadFile(kPoses);
}

TEST_F(BadInputTest, RefusesAMaskOfAnotherShape) {
  ClientFile& mask = FileOf(files_, "masks/frame-000003.json");
  mask.path = "masks/frame-000003.png";
  mask.bytes = testing::BlackPng(240, 320, 8);
  ExpectBadFile("masks/frame-000003.png");
}

TEST_F(BadInputTest, RefusesADepthMapThatClaimsABillionPixels) {
  ClientFile& depth = FileOf(files_, "depth/frame-000003.png");
  depth.path = "depth/frame-000003.pfm";
  depth.bytes = "Pf\n40000 30000\n-1\n" + std::string(4000, '\0');
  ExpectBadFile("depth/frame-000003.pfm");
}

TEST_F(BadInputTest, RefusesADepthMapThatIsNotFinite) {
  ClientFile& depth = FileOf(files_, "depth/frame-000003.png");
  depth.path = "depth/frame-000003.pfm";
  // All bits set: a NaN.
  depth.bytes = "Pf\n4 3\n-1\n" + std::string(48, '\xff');
  ExpectBadFile("depth/frame-000003.pfm");
}

TEST_F(BadInputTest, RefusesAPointCloudAsGaussians) {
  files_.push_back({"gaussians.ply", v1::FILE_KIND_GAUSSIANS,
                    "ply\nformat binary_little_endian 1.0\nelement vertex 2\nproperty float x\n"
                    "property float y\nproperty float z\nend_header\n" +
                        std::string(24, '\0')});
  ExpectBadFile("gaussians.ply: has no property");
}

TEST_F(BadInputTest, RefusesGaussiansThatClaimABillion) {
  files_.push_back({"gaussians.ply", v1::FILE_KIND_GAUSSIANS,
                    "ply\nformat binary_little_endian 1.0\nelement vertex 1000000000\n"
                    "property float x\nend_header\n" +
                        std::string(24, '\0')});
  ExpectBadFile("gaussians.ply: declares 1000000000 vertices");
}

TEST_F(BadInputTest, RefusesAHugeOneBitPng) {
  std::string& bytes = FileOf(files_, kPhoto).bytes;
  bytes = testing::BlackPng(32000, 32000, 1);
  EXPECT_LT(bytes.size(), 200'000u);  // small to send, 1 G pixels to decode
  ExpectBadFile(kPhoto);
}

TEST_F(BadInputTest, RefusesANameThatEscapesTheFolder) {
  FileOf(files_, kPhoto).path = "../../x";
  ExpectUploadRefused("../../x");
}

TEST_F(BadInputTest, RefusesAnEmptyFolder) {
  files_.clear();
  ExpectUploadRefused("files");
}

TEST_F(BadInputTest, RefusesAFolderWithoutPhotographs) {
  std::erase_if(files_, [](const ClientFile& file) { return file.kind == v1::FILE_KIND_IMAGE; });
  const v1::Job job = Train(files_);
  EXPECT_EQ(job.state(), v1::JOB_STATE_FAILED);
  EXPECT_EQ(job.error().code(), static_cast<int>(absl::StatusCode::kInvalidArgument))
      << job.error().message();
  ExpectServing();
}

TEST_F(BadInputTest, SurvivesAnUploadThatIsCutOff) {
  const auto is_photo = [](const ClientFile& file) { return file.kind == v1::FILE_KIND_IMAGE; };
  std::stable_partition(files_.begin(), files_.end(), is_photo);
  ASSERT_OK_AND_ASSIGN(const v1::Upload upload, client_.CreateUpload("shelf", files_));
  ASSERT_EQ(upload.missing_files_size(), static_cast<int>(files_.size()));
  // The upload ends in the middle of the third photograph.
  const size_t sent = files_[0].bytes.size() + files_[1].bytes.size() + 1;
  EXPECT_FALSE(client_.WriteFiles(upload, files_, sent).ok());
  EXPECT_STATUS(client_.SealUpload(upload.name()), absl::StatusCode::kFailedPrecondition,
                "are not uploaded");
  ASSERT_OK_AND_ASSIGN(const v1::Upload now, client_.GetUpload(upload.name()));
  // At most the two whole files are stored, and never the one that was cut.
  EXPECT_GE(now.missing_files_size(), upload.missing_files_size() - 2);
  EXPECT_THAT(now.missing_files(), ::testing::Contains(files_[2].path));
  EXPECT_STATUS(client_.Train("shelf", "scenes/shelf/datasets/1", ShortestOptions()),
                absl::StatusCode::kFailedPrecondition, "not sealed");
  ExpectServing();
}

}  // namespace
}  // namespace pepeseg
