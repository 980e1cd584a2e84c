#include <gtest/gtest.h>

#include "absl/time/clock.h"
#include "tests/server/running_server.h"

namespace pepeseg {
namespace {

struct DeleteUploadTest : ::testing::Test {
  DeleteUploadTest() : running(PEPESEG_FAKE_WORKER, WithAdmin()) { running.CreateScene("shelf"); }

  grpc::Status Delete(const std::string& name) {
    grpc::ClientContext context;
    v1::DeleteUploadRequest request;
    request.set_name(name);
    google::protobuf::Empty empty;
    return running.datasets->DeleteUpload(&context, request, &empty);
  }
  grpc::Status Get(const std::string& name) {
    grpc::ClientContext context;
    v1::GetUploadRequest request;
    request.set_name(name);
    v1::Upload upload;
    return running.datasets->GetUpload(&context, request, &upload);
  }
  v1::Quota Used() {
    grpc::ClientContext context;
    v1::GetProjectUsageRequest request;
    request.set_project("default");
    v1::ProjectUsage usage;
    EXPECT_TRUE(running.admin->GetProjectUsage(&context, request, &usage).ok());
    return usage.used();
  }
  void ExpectNothingLeft() {
    EXPECT_EQ(running.CountBlobFiles(), 0);
    EXPECT_EQ(running.CountPartialFiles(), 0);
    EXPECT_EQ(Used().stored_bytes(), 0);
    EXPECT_EQ(Used().open_uploads(), 0);
  }

  RunningServer running;
  const TestFile one{"images/1.jpg", std::string(1'000'000, '1')};
  const TestFile two{"images/2.jpg", std::string(2'000'000, '2')};
};

TEST_F(DeleteUploadTest, RemovesTheUploadWithItsBytesAndQuota) {
  const std::string name = running.CreateUpload("shelf", {one, two}).name();
  ASSERT_TRUE(running.Write(FileParts(name, one)).ok());
  EXPECT_FALSE(
      running.Write({HeaderPart(name, two.path), ChunkPart(two.bytes.substr(0, 1'000'000))}).ok());
  EXPECT_EQ(running.CountBlobFiles(), 1);
  EXPECT_GE(running.CountPartialFiles(), 1);
  EXPECT_EQ(Used().stored_bytes(), 3'000'000);
  const grpc::Status status = Delete(name);
  ASSERT_TRUE(status.ok()) << status.error_message();
  ExpectNothingLeft();
  EXPECT_EQ(Get(name).error_code(), grpc::NOT_FOUND);
  const grpc::Status again = Delete(name);
  EXPECT_EQ(again.error_code(), grpc::NOT_FOUND);
  EXPECT_EQ(DetailOf(again).reason(), "NO_SUCH_UPLOAD");
  EXPECT_EQ(DetailOf(again).resource(), name);
  EXPECT_EQ(DetailOf(Delete("shelf")).field(), "name");
  EXPECT_EQ(running.CreateUpload("shelf", {one}).missing_files_size(), 1) << "to be sent again";
}

TEST_F(DeleteUploadTest, KeepsFilesThatOtherDatasetsHave) {
  running.UploadAndSeal("shelf", {one});
  const v1::Upload upload = running.CreateUpload("shelf", {one, two});
  EXPECT_EQ(upload.missing_files_size(), 1);
  ASSERT_TRUE(running.Write(FileParts(upload.name(), two)).ok());
  EXPECT_EQ(running.CountBlobFiles(), 2);
  ASSERT_TRUE(Delete(upload.name()).ok());
  EXPECT_EQ(running.CountBlobFiles(), 1);
  EXPECT_EQ(Used().stored_bytes(), 1'000'000);
  EXPECT_EQ(running.CreateUpload("shelf", {one}).missing_files_size(), 0);
}

TEST_F(DeleteUploadTest, RefusesASealedUpload) {
  running.UploadAndSeal("shelf", {one});
  const grpc::Status sealed = Delete("scenes/shelf/uploads/1");
  EXPECT_EQ(sealed.error_code(), grpc::FAILED_PRECONDITION) << sealed.error_message();
  EXPECT_EQ(DetailOf(sealed).reason(), "SEALED");
  EXPECT_EQ(DetailOf(sealed).resource(), "scenes/shelf/uploads/1");
  EXPECT_TRUE(Get("scenes/shelf/uploads/1").ok());
  EXPECT_EQ(running.CountBlobFiles(), 1);
}

TEST_F(DeleteUploadTest, LeavesNothingOfAFileThatIsBeingWritten) {
  const std::string name = running.CreateUpload("shelf", {one, two}).name();
  grpc::ClientContext context;
  v1::WriteFilesResponse response;
  const auto stream = running.datasets->WriteFiles(&context, &response);
  ASSERT_TRUE(stream->Write(HeaderPart(name, two.path)));
  ASSERT_TRUE(stream->Write(ChunkPart(two.bytes.substr(0, 1'000'000))));
  while (running.CountPartialFiles() < 1) absl::SleepFor(absl::Milliseconds(5));
  ASSERT_TRUE(Delete(name).ok());
  stream->WritesDone();
  EXPECT_FALSE(stream->Finish().ok());
  ExpectNothingLeft();
}

TEST_F(DeleteUploadTest, LeavesNothingOfFilesThatAreNotCommittedYet) {
  const std::string name = running.CreateUpload("shelf", {one, two}).name();
  grpc::ClientContext context;
  v1::WriteFilesResponse response;
  const auto stream = running.datasets->WriteFiles(&context, &response);
  for (const v1::WriteFilesRequest& part : FileParts(name, one)) ASSERT_TRUE(stream->Write(part));
  while (running.CountPartialFiles() < 1) absl::SleepFor(absl::Milliseconds(5));
  ASSERT_TRUE(Delete(name).ok());
  stream->WritesDone();
  const grpc::Status ended = stream->Finish();
  EXPECT_EQ(ended.error_code(), grpc::NOT_FOUND) << ended.error_message();
  ExpectNothingLeft();
}

}  // namespace
}  // namespace pepeseg
