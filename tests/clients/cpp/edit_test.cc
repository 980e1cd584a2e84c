// Tests edits against a server of the test's own, which computes nothing.
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "clients/cpp/client.h"
#include "clients/cpp/resource_names.h"
#include "tests/clients/cpp/server_error.h"
#include "tests/testing/status_testing.h"

namespace pepeseg::client {
namespace {

// A server that puts off the first `num_refused` edits, then sends `num_parts` parts of progress.
class FakeEdits final : public v1::EditService::Service {
 public:
  FakeEdits() {
    grpc::ServerBuilder builder;
    busy_.retry_after = absl::Milliseconds(20);
    builder.RegisterService(this);
    server_ = builder.BuildAndStart();
  }
  ~FakeEdits() override { server_->Shutdown(); }

  grpc::Status EditModel(grpc::ServerContext* /*context*/, const v1::EditModelRequest* request,
                         grpc::ServerWriter<v1::EditModelResponse>* writer) override {
    const bool refuses = ++num_calls <= num_refused;
    v1::EditModelResponse part;
    for (int i = 1; i <= num_parts && (!refuses || refuses_late); ++i) {
      part.mutable_progress()->set_activity("training");
      part.mutable_progress()->set_num_done(i);
      writer->Write(part);
    }
    if (refuses) return ServerError(grpc::UNAVAILABLE, "not now", busy_);
    part.mutable_result()->set_edited_from(request->model());
    part.mutable_result()->set_num_removed(7);
    if (has_result) writer->Write(part);
    return grpc::Status::OK;
  }

  // Returns the result, and adds what progress was reported.
  absl::StatusOr<v1::EditModelResponse::Result> Edit() {
    v1::EditModelRequest request;
    request.set_model(ModelName("shelf"));
    return Client(server_->InProcessChannel({})).Edit(request, [this](const auto& progress) {
      done.push_back(progress.num_done());
    });
  }

  int num_refused = 0, num_parts = 2, num_calls = 0;
  bool refuses_late = false;  // after the progress
  bool has_result = true;
  std::vector<int64_t> done;

 private:
  ErrorDetail busy_;
  std::unique_ptr<grpc::Server> server_;
};

TEST(Edit, ReportsProgressAndReturnsTheResult) {
  FakeEdits edits;
  const auto result = edits.Edit();
  ASSERT_OK(result);
  EXPECT_EQ(result->edited_from(), "scenes/shelf/models/live");
  EXPECT_EQ(result->num_removed(), 7);
  EXPECT_EQ(edits.done, (std::vector<int64_t>{1, 2}));
}

TEST(Edit, IsRepeatedIfTheServerPutsItOff) {
  FakeEdits edits;
  edits.num_refused = 2;
  ASSERT_OK(edits.Edit());
  EXPECT_EQ(edits.num_calls, 3);
}

TEST(Edit, IsNotRepeatedOnceItHasBegun) {
  FakeEdits edits;
  edits.num_refused = 1;
  edits.refuses_late = true;
  EXPECT_TRUE(absl::IsUnavailable(edits.Edit().status()));
  EXPECT_EQ(edits.num_calls, 1);
}

TEST(Edit, NeedsAResult) {
  FakeEdits edits;
  edits.has_result = false;
  EXPECT_TRUE(absl::IsInternal(edits.Edit().status()));
}

}  // namespace
}  // namespace pepeseg::client
