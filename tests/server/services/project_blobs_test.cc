// A digest is known within its project only.
#include <gtest/gtest.h>

#include "tests/server/access/keyed_server.h"

namespace pepeseg {
namespace {

struct ProjectBlobsTest : KeyedServer {
  v1::Upload Upload(const std::string& scene, const std::string& secret, const TestFile& file) {
    v1::CreateUploadRequest request = Under{"scenes/" + scene};
    *request.add_files() = Declare(file);
    return *CallAs(secret, &DatasetStub::CreateUpload, request);
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
    return CallAs(secret, &DatasetStub::SealUpload, Named{upload.name()});
  }
};

TEST_F(ProjectBlobsTest, HidesBlobsOfOtherProjects) {
  const std::string theirs = MakeKey("other", {v1::SCOPE_READ, v1::SCOPE_WRITE, v1::SCOPE_TRAIN});
  v1::CreateSceneRequest create;
  create.set_scene_id("theirs");
  ASSERT_OK(CallAs(theirs, &SceneStub::CreateScene, create));
  const TestFile secret_photo{"images/1.jpg", "a photograph of ours"};
  const v1::Upload ours = Upload("shelf", full, secret_photo);
  ASSERT_OK(Send(ours, full, secret_photo));
  EXPECT_EQ(Upload("shelf", full, secret_photo).missing_files_size(), 0) << "our own";

  const v1::Upload upload = Upload("theirs", theirs, secret_photo);
  ASSERT_EQ(upload.missing_files_size(), 1);
  // A project that knows only the digest, and not the bytes, cannot use them.
  EXPECT_ERROR(Seal(upload, theirs), grpc::FAILED_PRECONDITION);
  TestFile wrong = secret_photo;
  wrong.bytes[0] = 'A';
  EXPECT_ERROR(Send(upload, theirs, wrong), grpc::DATA_LOSS);
  EXPECT_ERROR(Seal(upload, theirs), grpc::FAILED_PRECONDITION);
  const int64_t before = running.CountBlobFiles();
  ASSERT_OK(Send(upload, theirs, secret_photo));
  EXPECT_EQ(running.CountBlobFiles(), before + 1) << "each project has its own";
  EXPECT_OK(Seal(upload, theirs));
}

}  // namespace
}  // namespace pepeseg
