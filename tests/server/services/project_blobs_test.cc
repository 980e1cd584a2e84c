// A digest is known within its project only.
#include <gtest/gtest.h>

#include "tests/server/access/keyed_server.h"

namespace pepeseg {
namespace {

struct ProjectBlobsTest : KeyedServer {
  v1::Upload Upload(const std::string& scene, const std::string& secret, const TestFile& file) {
    auto context = With(secret);
    v1::CreateUploadRequest request;
    request.set_parent("scenes/" + scene);
    *request.add_files() = Declare(file);
    v1::Upload upload;
    const grpc::Status status = running.datasets->CreateUpload(context.get(), request, &upload);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return upload;
  }
  grpc::Status Send(const v1::Upload& upload, const std::string& secret, const TestFile& file) {
    auto context = With(secret);
    v1::WriteFilesResponse response;
    const auto stream = running.datasets->WriteFiles(context.get(), &response);
    for (const auto& part : FileParts(upload.name(), file)) {
      if (!stream->Write(part)) break;
    }
    stream->WritesDone();
    return stream->Finish();
  }
  grpc::Status Seal(const v1::Upload& upload, const std::string& secret) {
    auto context = With(secret);
    v1::SealUploadRequest request;
    request.set_name(upload.name());
    v1::Dataset dataset;
    return running.datasets->SealUpload(context.get(), request, &dataset);
  }
};

TEST_F(ProjectBlobsTest, HidesBlobsOfOtherProjects) {
  const std::string theirs = MakeKey("other", {v1::SCOPE_READ, v1::SCOPE_WRITE, v1::SCOPE_TRAIN});
  {
    auto context = With(theirs);
    v1::CreateSceneRequest request;
    request.set_scene_id("theirs");
    v1::Scene scene;
    ASSERT_TRUE(running.scenes->CreateScene(context.get(), request, &scene).ok());
  }
  const TestFile secret_photo{"images/1.jpg", "a photograph of ours"};
  const v1::Upload ours = Upload("shelf", full, secret_photo);
  ASSERT_TRUE(Send(ours, full, secret_photo).ok());
  EXPECT_EQ(Upload("shelf", full, secret_photo).missing_files_size(), 0) << "our own";

  const v1::Upload upload = Upload("theirs", theirs, secret_photo);
  ASSERT_EQ(upload.missing_files_size(), 1);
  // A project that knows only the digest, and not the bytes, cannot use them.
  EXPECT_EQ(Seal(upload, theirs).error_code(), grpc::FAILED_PRECONDITION);
  TestFile wrong = secret_photo;
  wrong.bytes[0] = 'A';
  EXPECT_EQ(Send(upload, theirs, wrong).error_code(), grpc::DATA_LOSS);
  EXPECT_EQ(Seal(upload, theirs).error_code(), grpc::FAILED_PRECONDITION);
  const int64_t before = running.CountBlobFiles();
  ASSERT_TRUE(Send(upload, theirs, secret_photo).ok());
  EXPECT_EQ(running.CountBlobFiles(), before + 1) << "each project has its own";
  EXPECT_TRUE(Seal(upload, theirs).ok());
}

}  // namespace
}  // namespace pepeseg
