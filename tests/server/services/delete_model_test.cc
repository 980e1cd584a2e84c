#include "tests/server/shelf_model.h"

namespace pepeseg {
namespace {

struct DeleteModelTest : ShelfModel {
  grpc::Status Delete(const std::string& name) {
    grpc::ClientContext context;
    v1::DeleteModelRequest request;
    request.set_name(name);
    google::protobuf::Empty nothing;
    return running.scenes->DeleteModel(&context, request, &nothing);
  }
  grpc::Status ListViews() {
    grpc::ClientContext context;
    v1::ListViewsRequest request;
    request.set_parent(kModel);
    v1::ListViewsResponse response;
    return running.scenes->ListViews(&context, request, &response);
  }
};

TEST_F(DeleteModelTest, RemovesFilesAndMemory) {
  ASSERT_TRUE(ListViews().ok()) << "it is in memory now";
  const auto folder = running.options.data / "jobs/j1/attempt-1";
  ASSERT_TRUE(std::filesystem::exists(folder));
  const grpc::Status status = Delete("scenes/shelf/models/1");
  ASSERT_TRUE(status.ok()) << status.error_message();
  EXPECT_FALSE(std::filesystem::exists(folder));
  EXPECT_EQ(ListViews().error_code(), grpc::FAILED_PRECONDITION);
  EXPECT_EQ(Delete("scenes/shelf/models/1").error_code(), grpc::NOT_FOUND);
  EXPECT_EQ(Delete("models/1").error_code(), grpc::INVALID_ARGUMENT);
}

TEST_F(DeleteModelTest, MakesTheModelBeforeItLive) {
  const v1::Job second = running.Await(running.Train("shelf", "file").name());
  ASSERT_EQ(second.model(), "scenes/shelf/models/2");
  ASSERT_TRUE(Delete(kModel).ok());
  EXPECT_EQ(Delete("scenes/shelf/models/2").error_code(), grpc::NOT_FOUND);
  EXPECT_TRUE(ListViews().ok());
  EXPECT_TRUE(Delete("scenes/shelf/models/1").ok());
}

}  // namespace
}  // namespace pepeseg
