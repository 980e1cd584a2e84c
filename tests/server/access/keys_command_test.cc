// `pepesegd keys`, with and without a running server.
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"
#include "server/store/layout.h"
#include "tests/server/access/keyed_server.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

struct Outcome {
  int code = -1;
  std::string text;  // standard output
};

Outcome RunKeys(const std::filesystem::path& data, const std::string& arguments) {
  const std::string line =
      absl::StrCat(PEPESEG_SERVER, " keys ", arguments, " --data ", data.string(), " 2>/dev/null");
  Outcome outcome;
  FILE* pipe = popen(line.c_str(), "r");
  char buffer[4096];
  while (std::fgets(buffer, sizeof(buffer), pipe) != nullptr) outcome.text += buffer;
  outcome.code = WEXITSTATUS(pclose(pipe));
  return outcome;
}

grpc::Status ListScenes(RunningServer& running, const std::string& secret) {
  return CallWith(*KeyedServer::With(secret), running.channel, &SceneStub::ListScenes, {});
}

TEST(KeysCommand, CreatesTheFirstKeyBeforeTheServerStarts) {
  const testing::TempFolder folder;
  const Outcome made =
      RunKeys(folder / "data", "create --project lab --scopes read,write --name \"My laptop\"");
  ASSERT_EQ(made.code, 0) << made.text;
  const std::string secret(absl::StripSuffix(made.text, "\n"));
  EXPECT_EQ(secret.rfind("pk_", 0), 0u);
  EXPECT_EQ(secret.find('\n'), std::string::npos);
  const Outcome list = RunKeys(folder / "data", "list");
  EXPECT_NE(list.text.find("lab"), std::string::npos);
  EXPECT_NE(list.text.find("read,write"), std::string::npos);
  EXPECT_NE(list.text.find("My laptop"), std::string::npos);
  EXPECT_EQ(list.text.find(secret), std::string::npos);

  ServerOptions options;
  options.data = folder / "data";
  options.worker = PEPESEG_FAKE_WORKER;
  options.devices = "cpu";
  options.access.require_keys = true;
  ASSERT_OK_AND_ASSIGN(const auto server, Server::Start(options));
  const auto scenes = v1::SceneService::NewStub(server->InProcessChannel());
  v1::ListScenesResponse response;
  EXPECT_OK(scenes->ListScenes(KeyedServer::With(secret).get(), {}, &response));
  EXPECT_ERROR(scenes->ListScenes(KeyedServer::With("").get(), {}, &response),
               grpc::UNAUTHENTICATED);
}

TEST(KeysCommand, CreatesAndRevokesKeysOfARunningServer) {
  ServerOptions options;
  options.access.require_keys = true;
  RunningServer running(PEPESEG_FAKE_WORKER, options);
  const auto& data = running.options.data;
  const Outcome made = RunKeys(data, "create --project lab --scopes read --expires-days 1");
  ASSERT_EQ(made.code, 0) << made.text;
  const std::string secret(absl::StripSuffix(made.text, "\n"));
  EXPECT_OK(ListScenes(running, secret));
  const std::string list = RunKeys(data, "list").text;
  const std::string name = list.substr(0, list.find(' '));
  EXPECT_NE(list.find("valid until"), std::string::npos) << list;
  EXPECT_EQ(RunKeys(data, "revoke " + name).code, 0);
  EXPECT_ERROR(ListScenes(running, secret), grpc::UNAUTHENTICATED);
  EXPECT_NE(RunKeys(data, "list").text.find("revoked"), std::string::npos);

  std::ifstream file(AuditPath(data));
  std::vector<std::string> outcomes;
  for (std::string line; std::getline(file, line);) {
    const auto entry = nlohmann::json::parse(line);
    EXPECT_EQ(entry["resources"][0], name);
    outcomes.push_back(
        absl::StrCat(entry["method"].get<std::string>(), " ", entry["outcome"].get<std::string>()));
  }
  EXPECT_EQ(outcomes,
            (std::vector<std::string>{"pepesegd keys create BEGUN", "pepesegd keys create OK",
                                      "pepesegd keys revoke BEGUN", "pepesegd keys revoke OK"}));
}

TEST(KeysCommand, RefusesInvalidArguments) {
  const testing::TempFolder folder;
  for (const char* bad :
       {"create --project lab --scopes all", "create --project Lab --scopes read",
        "create --project lab", "create --scopes read", "revoke keys/0000000000000000",
        "create --project lab --scopes read --expires-days 0", "destroy"}) {
    const Outcome outcome = RunKeys(folder / "data", bad);
    EXPECT_NE(outcome.code, 0) << bad;
    EXPECT_EQ(outcome.text.find("pk_"), std::string::npos) << bad;
  }
}

}  // namespace
}  // namespace pepeseg
