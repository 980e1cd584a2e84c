// Tests of calls that a server puts off.
#include "clients/cpp/call.h"

#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <chrono>

#include "pepeseg/v1/scene_service.grpc.pb.h"
#include "tests/clients/cpp/server_error.h"
#include "tests/testing/status_testing.h"

namespace pepeseg::client {
namespace {

// A server that puts off the first `num_refused` calls.
class BusyScenes final : public v1::SceneService::Service {
 public:
  BusyScenes() {
    grpc::ServerBuilder builder;
    builder.RegisterService(this);
    server_ = builder.BuildAndStart();
    stub = v1::SceneService::NewStub(server_->InProcessChannel({}));
  }
  ~BusyScenes() override { server_->Shutdown(); }

  grpc::Status GetScene(grpc::ServerContext*, const v1::GetSceneRequest* request,
                        v1::Scene* scene) override {
    scene->set_name(request->name());
    if (++num_calls > num_refused) return grpc::Status::OK;
    return ServerError(code, "not now", detail);
  }

  absl::StatusOr<v1::Scene> Get(double seconds) {
    v1::GetSceneRequest request;
    request.set_name("scenes/a");
    return Ask(*stub, &v1::SceneService::Stub::GetScene, "a", request, seconds);
  }

  grpc::StatusCode code = grpc::UNAVAILABLE;
  ErrorDetail detail;
  int num_refused = 2, num_calls = 0;
  std::unique_ptr<v1::SceneService::Stub> stub;

 private:
  std::unique_ptr<grpc::Server> server_;
};

TEST(Ask, RepeatsCallsThatTheServerPutsOff) {
  BusyScenes scenes;
  scenes.detail.reason = "NO_ROOM_NOW";
  scenes.detail.retry_after = absl::Milliseconds(50);
  const auto start = std::chrono::steady_clock::now();
  const auto scene = scenes.Get(20);
  ASSERT_OK(scene);
  EXPECT_EQ(scene->name(), "scenes/a");
  EXPECT_EQ(scenes.num_calls, 3);
  EXPECT_GE(std::chrono::steady_clock::now() - start, std::chrono::milliseconds(100));
}

TEST(Ask, GivesUpIfTheWaitWouldPassTheDeadline) {
  BusyScenes scenes;
  scenes.num_refused = 1000;
  scenes.detail.retry_after = absl::Seconds(30);
  const auto start = std::chrono::steady_clock::now();
  EXPECT_TRUE(absl::IsUnavailable(scenes.Get(5).status()));
  EXPECT_EQ(scenes.num_calls, 1);
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(5));
}

TEST(Ask, CallsOnceIfWaitingDoesNotHelp) {
  for (const bool draining : {false, true}) {
    BusyScenes scenes;
    if (draining) scenes.detail.retry_after = absl::Nanoseconds(1);
    scenes.detail.reason = draining ? "DRAINING" : "UNAVAILABLE";
    EXPECT_TRUE(absl::IsUnavailable(scenes.Get(5).status()));
    EXPECT_EQ(scenes.num_calls, 1);
  }
  BusyScenes scenes;
  scenes.code = grpc::RESOURCE_EXHAUSTED;
  scenes.detail.retry_after = absl::Nanoseconds(1);
  EXPECT_TRUE(absl::IsResourceExhausted(scenes.Get(5).status()));
  EXPECT_EQ(scenes.num_calls, 1);
}

}  // namespace
}  // namespace pepeseg::client
