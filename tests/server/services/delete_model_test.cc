#include "tests/server/shelf_model.h"

namespace pepeseg {
namespace {

struct DeleteModelTest : ShelfModel {
  grpc::Status Delete(const std::string& name) {
    return Call(&SceneStub::DeleteModel, Named{name});
  }
  grpc::Status ListViews() { return Call(&SceneStub::ListViews, Under{kModel}); }
};

TEST_F(DeleteModelTest, RemovesFilesAndMemory) {
  ASSERT_OK(ListViews()) << "it is in memory now";
  const auto folder = running.options.data / "jobs/j1/attempt-1";
  ASSERT_TRUE(std::filesystem::exists(folder));
  ASSERT_OK(Delete("scenes/shelf/models/1"));
  EXPECT_FALSE(std::filesystem::exists(folder));
  EXPECT_ERROR(ListViews(), grpc::FAILED_PRECONDITION);
  EXPECT_ERROR(Delete("scenes/shelf/models/1"), grpc::NOT_FOUND);
  EXPECT_ERROR(Delete("models/1"), grpc::INVALID_ARGUMENT);
}

TEST_F(DeleteModelTest, MakesTheModelBeforeItLive) {
  ASSERT_EQ(TrainToTheEnd("shelf", "file").model(), "scenes/shelf/models/2");
  ASSERT_OK(Delete(kModel));
  EXPECT_ERROR(Delete("scenes/shelf/models/2"), grpc::NOT_FOUND);
  EXPECT_OK(ListViews());
  EXPECT_OK(Delete("scenes/shelf/models/1"));
}

}  // namespace
}  // namespace pepeseg
