#include <gtest/gtest.h>

#include "tests/server/service_test.h"

namespace pepeseg {
namespace {

struct DeleteUploadTest : EmptyScene {
  DeleteUploadTest() : EmptyScene(PEPESEG_FAKE_WORKER, WithAdmin()) {}

  grpc::Status Delete(const std::string& name) {
    return Call(&DatasetStub::DeleteUpload, Named{name});
  }
  grpc::Status Get(const std::string& name) { return Call(&DatasetStub::GetUpload, Named{name}); }
  v1::Quota Used() {
    v1::GetProjectUsageRequest request;
    request.set_project("default");
    return Call(&AdminStub::GetProjectUsage, request)->used();
  }
  void ExpectNothingLeft() {
    EXPECT_EQ(running.CountBlobFiles(), 0);
    EXPECT_EQ(running.CountPartialFiles(), 0);
    EXPECT_EQ(Used().stored_bytes(), 0);
    EXPECT_EQ(Used().open_uploads(), 0);
  }

  const TestFile one{"images/1.jpg", std::string(1'000'000, '1')};
  const TestFile two{"images/2.jpg", std::string(2'000'000, '2')};
};

TEST_F(DeleteUploadTest, RemovesTheUploadWithItsBytesAndQuota) {
  const std::string name = running.CreateUpload("shelf", {one, two}).name();
  ASSERT_OK(running.Write(FileParts(name, one)));
  EXPECT_FALSE(
      running.Write({HeaderPart(name, two.path), ChunkPart(two.bytes.substr(0, 1'000'000))}).ok());
  EXPECT_EQ(running.CountBlobFiles(), 1);
  EXPECT_GE(running.CountPartialFiles(), 1);
  EXPECT_EQ(Used().stored_bytes(), 3'000'000);
  ASSERT_OK(Delete(name));
  ExpectNothingLeft();
  EXPECT_ERROR(Get(name), grpc::NOT_FOUND);
  EXPECT_ERROR(Delete(name), grpc::NOT_FOUND, {.reason = "NO_SUCH_UPLOAD", .resource = name});
  EXPECT_ERROR(Delete("shelf"), grpc::INVALID_ARGUMENT, "name");
  EXPECT_EQ(running.CreateUpload("shelf", {one}).missing_files_size(), 1) << "to be sent again";
}

TEST_F(DeleteUploadTest, KeepsFilesThatOtherDatasetsHave) {
  running.UploadAndSeal("shelf", {one});
  const v1::Upload upload = running.CreateUpload("shelf", {one, two});
  EXPECT_EQ(upload.missing_files_size(), 1);
  ASSERT_OK(running.Write(FileParts(upload.name(), two)));
  EXPECT_EQ(running.CountBlobFiles(), 2);
  ASSERT_OK(Delete(upload.name()));
  EXPECT_EQ(running.CountBlobFiles(), 1);
  EXPECT_EQ(Used().stored_bytes(), 1'000'000);
  EXPECT_EQ(running.CreateUpload("shelf", {one}).missing_files_size(), 0);
}

TEST_F(DeleteUploadTest, RefusesASealedUpload) {
  running.UploadAndSeal("shelf", {one});
  EXPECT_ERROR(Delete("scenes/shelf/uploads/1"), grpc::FAILED_PRECONDITION,
               {.reason = "SEALED", .resource = "scenes/shelf/uploads/1"});
  EXPECT_OK(Get("scenes/shelf/uploads/1"));
  EXPECT_EQ(running.CountBlobFiles(), 1);
}

TEST_F(DeleteUploadTest, LeavesNothingOfAFileThatIsBeingWritten) {
  const std::string name = running.CreateUpload("shelf", {one, two}).name();
  grpc::ClientContext context;
  v1::WriteFilesResponse response;
  const auto stream = running.datasets->WriteFiles(&context, &response);
  ASSERT_TRUE(stream->Write(HeaderPart(name, two.path)));
  ASSERT_TRUE(stream->Write(ChunkPart(two.bytes.substr(0, 1'000'000))));
  ASSERT_TRUE(Eventually([&] { return running.CountPartialFiles() > 0; }));
  ASSERT_OK(Delete(name));
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
  ASSERT_TRUE(Eventually([&] { return running.CountPartialFiles() > 0; }));
  ASSERT_OK(Delete(name));
  stream->WritesDone();
  EXPECT_ERROR(stream->Finish(), grpc::NOT_FOUND);
  ExpectNothingLeft();
}

}  // namespace
}  // namespace pepeseg
