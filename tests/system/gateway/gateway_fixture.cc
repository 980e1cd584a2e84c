#include "tests/system/gateway/gateway_fixture.h"

#include <atomic>
#include <chrono>
#include <mutex>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "tests/testing/eventually.h"

namespace pepeseg::testing {
namespace {

void Prepare(grpc::ClientContext& context) {
  context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(30));
}

}  // namespace

std::unique_ptr<Fleet> GatewayTest::fleet_;

void GatewayTest::SetUpTestSuite() {
  if (!HasHaproxy()) return;
  FleetOptions options;
  // A short window, so that tests can wait for its end. Abuse also comes from this machine's
  // address.
  options.gateway_environment = {"PEPESEG_CALLS_WINDOW=2s", "PEPESEG_SOURCE_CONNECTIONS=1000",
                                 "PEPESEG_SOURCE_CONNECTION_RATE=5000"};
  fleet_ = std::make_unique<Fleet>(options);
}

void GatewayTest::SetUp() {
  if (fleet_ == nullptr) GTEST_SKIP() << "haproxy or lua-luaossl is not installed";
}

grpc::Status GatewayTest::List(const std::shared_ptr<grpc::Channel>& channel,
                               const Metadata& metadata) {
  grpc::ClientContext context;
  Prepare(context);
  for (const auto& [name, value] : metadata) context.AddMetadata(name, value);
  return CallWith(context, channel, &SceneStub::ListScenes, {});
}

std::map<std::string, int> GatewayTest::ListAtOnce(const std::string& token, int num_calls) {
  struct Call {
    grpc::ClientContext context;
    v1::ListScenesRequest request;
    v1::ListScenesResponse response;
  };
  const auto stub = v1::SceneService::NewStub(fleet().Connect(token));
  std::vector<Call> calls(static_cast<size_t>(num_calls));
  std::mutex mutex;
  std::map<std::string, int> answers;
  std::atomic<int> num_open = num_calls;
  for (Call& call : calls) {
    Prepare(call.context);
    stub->async()->ListScenes(&call.context, &call.request, &call.response,
                              [&](const grpc::Status& status) {
                                const std::lock_guard lock(mutex);
                                ++answers[TextOf(status)];
                                --num_open;
                              });
  }
  EXPECT_TRUE(testing::Eventually([&] { return num_open == 0; }));
  const std::lock_guard lock(mutex);
  return answers;
}

grpc::Status GatewayTest::CreateScene(const std::string& token, const std::string& id) {
  grpc::ClientContext context;
  Prepare(context);
  v1::CreateSceneRequest request;
  request.set_scene_id(id);
  return CallWith(context, fleet().Connect(token), &SceneStub::CreateScene, request);
}

grpc::Status GatewayTest::GetScene(const std::string& token, const std::string& id) {
  grpc::ClientContext context;
  Prepare(context);
  context.AddMetadata("x-scene", id);
  return CallWith(context, fleet().Connect(token), &SceneStub::GetScene, Named{"scenes/" + id});
}

std::string TextOf(const grpc::Status& status) {
  return absl::StrCat(absl::StatusCodeToString(static_cast<absl::StatusCode>(status.error_code())),
                      ": ", status.error_message());
}

}  // namespace pepeseg::testing
