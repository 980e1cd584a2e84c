// Stored files whose bytes change on the disk: a worker finds them, the server sets them aside, and
// the next upload stores them again.
#include <gtest/gtest.h>

#include <fstream>

#include "core/base/digest.h"
#include "server/store/layout.h"
#include "tests/server/service_test.h"

namespace pepeseg {
namespace {

struct DamagedBlobsTest : EmptyScene {
  // The fake worker acts by the name of the first file.
  DamagedBlobsTest() : EmptyScene(PEPESEG_FAKE_WORKER) {}

  BlobName NameOf(const TestFile& file) const { return {"default", Sha256Hex(file.bytes)}; }
  std::filesystem::path BlobOf(const TestFile& file) const {
    return BlobPath(running.options.data, NameOf(file));
  }
  void Flip(const TestFile& file) const {
    std::string bytes = file.bytes;
    bytes[0] = static_cast<char>(bytes[0] ^ 1);
    std::ofstream(BlobOf(file), std::ios::binary) << bytes;
  }
  v1::TrainSceneRequest Request(const std::string& dataset) const {
    v1::TrainSceneRequest request;
    request.set_scene("scenes/shelf");
    request.set_dataset(dataset);
    return request;
  }
  Reply<v1::Job> Train(const std::string& dataset) const {
    return Call(&JobStub::TrainScene, Request(dataset));
  }
  // Trains, and returns the job once it has ended.
  v1::Job TrainToTheEnd(const std::string& dataset) const {
    return running.Await(Train(dataset)->name());
  }

  const std::vector<TestFile> files = {
      {"verify", "a photograph"}, {"x/b", "another one"}, {"x/c", "a third one"}};
};

TEST_F(DamagedBlobsTest, AreSetAsideAndHealedByAnUploadOfTheSameFiles) {
  const std::string dataset = running.UploadAndSeal("shelf", files);
  ASSERT_EQ(TrainToTheEnd(dataset).state(), v1::JOB_STATE_SUCCEEDED);
  Flip(files[1]);

  const v1::Job failed = TrainToTheEnd(dataset);
  EXPECT_EQ(failed.state(), v1::JOB_STATE_FAILED);
  EXPECT_EQ(failed.error().code(), grpc::DATA_LOSS);
  EXPECT_EQ(failed.error().message(), "x/b: its stored bytes are damaged");
  // The blob is set aside before clients can see that the job has failed.
  EXPECT_FALSE(std::filesystem::exists(BlobOf(files[1])));
  EXPECT_TRUE(std::filesystem::exists(DamagedPath(running.options.data, NameOf(files[1]))));
  EXPECT_TRUE(std::filesystem::exists(BlobOf(files[0])));

  EXPECT_ERROR(Train(dataset), grpc::FAILED_PRECONDITION,
               {.reason = "FILES_MISSING", .resource = "x/b", .message = "1 of 3 files"});

  const v1::Upload again = running.CreateUpload("shelf", files);
  ASSERT_EQ(again.missing_files_size(), 1);
  EXPECT_EQ(again.missing_files(0), "x/b");
  ASSERT_OK(running.Write(FileParts(again.name(), files[1])));
  EXPECT_EQ(TrainToTheEnd(dataset).state(), v1::JOB_STATE_SUCCEEDED) << "the old dataset";
}

TEST_F(DamagedBlobsTest, AreMissingForEveryDatasetAndOpenUploadThatNamesThem) {
  const std::string dataset = running.UploadAndSeal("shelf", files);
  const v1::Upload open = running.CreateUpload("shelf", files);
  EXPECT_EQ(open.missing_files_size(), 0);
  Flip(files[2]);
  EXPECT_EQ(TrainToTheEnd(dataset).error().code(), grpc::DATA_LOSS);
  EXPECT_EQ(running.GetUpload(open.name()).missing_files_size(), 1);
  EXPECT_ERROR(Call(&DatasetStub::SealUpload, Named{open.name()}), grpc::FAILED_PRECONDITION);
}

TEST_F(DamagedBlobsTest, AreVerifiedByTheServerItself) {
  std::vector<TestFile> good = files;
  good[0].path = "claim damage";
  const std::string dataset = running.UploadAndSeal("shelf", good);
  const v1::Job failed = TrainToTheEnd(dataset);
  EXPECT_EQ(failed.state(), v1::JOB_STATE_FAILED);
  EXPECT_EQ(failed.error().code(), grpc::INTERNAL);
  EXPECT_NE(failed.error().message().find("the stored files are whole"), std::string::npos)
      << failed.error().message();
  for (const TestFile& file : good) EXPECT_TRUE(std::filesystem::exists(BlobOf(file)));
  EXPECT_TRUE(std::filesystem::exists(DatabasePath(running.options.data)));
  EXPECT_FALSE(std::filesystem::exists(DamagedFolder(running.options.data)));
  EXPECT_OK(Train(dataset));
}

// As after an operator has removed a blob, or a disk was lost.
TEST_F(DamagedBlobsTest, FailTheTrainingAtOnceWhenTheyAreMissing) {
  const std::string dataset = running.UploadAndSeal("shelf", files);
  std::filesystem::remove(BlobOf(files[0]));
  EXPECT_ERROR(Train(dataset), grpc::FAILED_PRECONDITION);
  const v1::Upload again = running.CreateUpload("shelf", files);
  ASSERT_EQ(again.missing_files_size(), 1);
  ASSERT_OK(running.Write(FileParts(again.name(), files[0])));
  EXPECT_EQ(TrainToTheEnd(dataset).state(), v1::JOB_STATE_SUCCEEDED);
}

}  // namespace
}  // namespace pepeseg
