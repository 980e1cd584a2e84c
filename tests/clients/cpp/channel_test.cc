#include "clients/cpp/channel.h"

#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "clients/cpp/answer_status.h"
#include "pepeseg/v1/scene_service.grpc.pb.h"
#include "tests/testing/status_testing.h"

namespace pepeseg::client {
namespace {

struct ChannelTest : ::testing::Test {
  ChannelTest() {
    unsetenv("PEPESEG_KEY");
    std::ofstream(file) << "pk_secret\nand a remark\n";
  }
  ~ChannelTest() override {
    unsetenv("PEPESEG_KEY");
    std::filesystem::remove(file);
  }
  const std::filesystem::path file = std::filesystem::path(::testing::TempDir()) /
                                     ("pepeseg_channel_test_key" + std::to_string(getpid()));
};

TEST_F(ChannelTest, SendsNoKeyUnencryptedToAnotherMachine) {
  Login login;
  login.key_file = file;
  for (const char* here : {"127.0.0.1:1", "localhost:1", "[::1]:1", "unix:/tmp/x"}) {
    EXPECT_OK(OpenChannel(here, login)) << here;
  }
  for (const char* beyond : {"10.0.0.1:1", "example.org:1", "127.0.0.1.example.org:1",
                             "localhost.example.org:1", "dns:///127.0.0.1:1"}) {
    const auto refused = OpenChannel(beyond, login);
    EXPECT_EQ(refused.status().code(), absl::StatusCode::kInvalidArgument) << beyond;
    EXPECT_NE(refused.status().message().find("not encrypted"), std::string::npos);
    EXPECT_EQ(refused.status().message().find("pk_secret"), std::string::npos);
    EXPECT_OK(OpenChannel(beyond, {})) << "there is no key to hide";
    EXPECT_OK(OpenChannel(std::string("https://") + beyond, login)) << beyond;
    Login encrypted = login;
    encrypted.tls = true;
    EXPECT_OK(OpenChannel(beyond, encrypted)) << beyond;
  }
}

TEST_F(ChannelTest, TakesAnAddressWithoutTlsAsBrowsersWriteIt) {
  Login login;
  EXPECT_OK(OpenChannel("http://127.0.0.1:1", login));
  login.key_file = file;
  EXPECT_OK(OpenChannel("http://127.0.0.1:1", login));
  EXPECT_FALSE(OpenChannel("http://10.0.0.1:1", login).ok()) << "the key is not sent there";
  login.tls = true;
  const auto refused = OpenChannel("http://127.0.0.1:1", login);
  EXPECT_EQ(refused.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_NE(refused.status().message().find("asks for TLS"), std::string::npos);
}

TEST_F(ChannelTest, ReadsTheKeyFromTheEnvironment) {
  setenv("PEPESEG_KEY", "pk_secret", 1);
  EXPECT_FALSE(OpenChannel("example.org:1", {}).ok());
  setenv("PEPESEG_KEY", "", 1);
  EXPECT_OK(OpenChannel("example.org:1", {}));
  setenv("PEPESEG_KEY", "no key", 1);
  EXPECT_FALSE(OpenChannel("127.0.0.1:1", {}).ok());
  for (const char* jwt : {"eyJh.eyJi.c2-_", "a.b.c"}) {
    setenv("PEPESEG_KEY", jwt, 1);
    EXPECT_OK(OpenChannel("127.0.0.1:1", {})) << jwt;
    EXPECT_FALSE(OpenChannel("example.org:1", {}).ok()) << "not encrypted";
  }
  for (const char* bad : {"a.b", "a.b.c.d", ".b.c", "a.b.", "a..c", "..", "a.b c.d", "a.b.\xff"}) {
    setenv("PEPESEG_KEY", bad, 1);
    EXPECT_FALSE(OpenChannel("127.0.0.1:1", {}).ok()) << bad;
  }
  setenv("PEPESEG_KEY", "no key", 1);
  Login login;
  login.key_file = file;  // overrides PEPESEG_KEY
  EXPECT_OK(OpenChannel("127.0.0.1:1", login));
}

// A server that records the authorization of each call.
struct Listener final : v1::SceneService::Service {
  grpc::Status ListScenes(grpc::ServerContext* context, const v1::ListScenesRequest*,
                          v1::ListScenesResponse*) override {
    const auto [begin, end] = context->client_metadata().equal_range("authorization");
    for (auto it = begin; it != end; ++it) shown.emplace_back(it->second.data(), it->second.size());
    return grpc::Status::OK;
  }
  std::vector<std::string> shown;
};

std::unique_ptr<grpc::Server> Start(Listener& listener, std::string* address) {
  grpc::ServerBuilder builder;
  int port = 0;
  builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port);
  builder.RegisterService(&listener);
  auto server = builder.BuildAndStart();
  *address = "127.0.0.1:" + std::to_string(port);
  return server;
}

absl::Status List(const std::shared_ptr<grpc::Channel>& channel) {
  grpc::ClientContext context;
  v1::ListScenesResponse response;
  return FromGrpc(v1::SceneService::NewStub(channel)->ListScenes(&context, {}, &response));
}

TEST_F(ChannelTest, CallsThisMachineWithoutAProxy) {
  Listener listener;
  std::string address;
  const auto server = Start(listener, &address);
  setenv("http_proxy", "http://127.0.0.1:1", 1);
  setenv("no_proxy", "127.0.0.0/8", 1);
  EXPECT_OK(List(*OpenChannel(address, {})));
  unsetenv("http_proxy");
  unsetenv("no_proxy");
}

TEST_F(ChannelTest, SendsTheKeyWithEveryCall) {
  Listener listener;
  std::string address;
  const auto server = Start(listener, &address);
  const auto list = [](const std::shared_ptr<grpc::Channel>& channel) { EXPECT_OK(List(channel)); };
  Login login;
  login.key_file = file;
  const auto channel = *OpenChannel(address, login);
  list(channel);
  list(channel);
  EXPECT_EQ(listener.shown, (std::vector<std::string>(2, "Bearer pk_secret")));
  list(*OpenChannel(address, {}));
  EXPECT_EQ(listener.shown.size(), 2u);
}

TEST_F(ChannelTest, NamesTheFileThatIsRefused) {
  Login login;
  login.key_file = file.string() + ".none";
  EXPECT_NE(OpenChannel("127.0.0.1:1", login).status().message().find(".none"), std::string::npos);
  std::ofstream(file) << "";
  login.key_file = file;
  EXPECT_NE(OpenChannel("127.0.0.1:1", login).status().message().find("neither an API key"),
            std::string::npos);
  Login half;
  half.certificate = file;
  EXPECT_NE(OpenChannel("127.0.0.1:1", half).status().message().find("together"),
            std::string::npos);
  Login ca;
  ca.ca = file.string() + ".none";
  EXPECT_FALSE(OpenChannel("127.0.0.1:1", ca).ok());
}

}  // namespace
}  // namespace pepeseg::client
