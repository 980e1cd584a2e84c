// Several servers behind the gateway: the cost of a restart, of a kill, and of another server.
#include <gmock/gmock.h>

#include <cstdio>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "grpcpp/generic/generic_stub.h"
#include "tests/server/service_client.h"
#include "tests/server/store/test_database.h"
#include "tests/system/gateway/fleet.h"
#include "tests/system/gateway/from_environment.h"
#include "tests/system/gateway/steady_load.h"
#include "tests/testing/status_testing.h"

namespace pepeseg::testing {
namespace {

constexpr int kNumScenes = 12;

// Returns, by scene or key, the server that answered last, from the gateway's log.
std::map<std::string, std::string> ServersOf(const std::vector<nlohmann::json>& lines) {
  std::map<std::string, std::string> servers;
  for (const nlohmann::json& line : lines) {
    if (line["server"] != "<NOSRV>" && line["scene"] != "-")
      servers[line["scene"]] = line["server"];
  }
  return servers;
}

struct LoadedFleet : ::testing::Test {
  explicit LoadedFleet(int num_servers = 3) : fleet(Options(num_servers)) {}
  FleetOptions Options(int num_servers) {
    FleetOptions options;
    options.num_servers = num_servers;
    options.database = database.NewDatabase();
    options.worker = PEPESEG_MODEL_WORKER;
    options.gateway_environment = {"PEPESEG_CALLS=1000000"};
    return options;
  }
  std::string Token() const {
    return fleet.issuer.Sign(TokenIssuer::Claims("lab", "read write train"));
  }
  void MakeScenes() {
    ServiceClient client(fleet.Connect(Token()));
    std::vector<std::string> jobs;
    for (int i = 0; i < kNumScenes; ++i) {
      const std::string scene = SteadyLoad::SceneId(i);
      ASSERT_OK(client.CreateScene(scene));
      ASSERT_OK_AND_ASSIGN(const std::string dataset,
                           client.Upload(scene, {{"file", v1::FILE_KIND_IMAGE, scene}}));
      ASSERT_OK_AND_ASSIGN(const v1::Job job, client.Train(scene, dataset, {}));
      jobs.push_back(job.name());
    }
    for (const std::string& job : jobs) {
      ASSERT_OK_AND_ASSIGN(const v1::Job done, client.WaitForJob(job));
      ASSERT_EQ(done.state(), v1::JOB_STATE_SUCCEEDED) << done.DebugString();
    }
  }
  // Calls each scene once, so that its model is loaded on the server that gets its calls.
  void Warm() {
    const auto stub = v1::SegmentationService::NewStub(fleet.Connect(Token()));
    for (int i = 0; i < kNumScenes; ++i) {
      grpc::ClientContext context;
      context.AddMetadata("x-scene", SteadyLoad::SceneId(i));
      v1::SegmentViewsResponse response;
      const grpc::Status status =
          stub->SegmentViews(&context, SteadyLoad::SmallQuery(SteadyLoad::SceneId(i)), &response);
      ASSERT_OK(status);
    }
  }
  std::unique_ptr<SteadyLoad> StartLoad() {
    Warm();
    std::vector<std::shared_ptr<grpc::Channel>> channels;
    for (int i = 0; i < 4; ++i) channels.push_back(fleet.Connect(Token()));
    auto load = std::make_unique<SteadyLoad>(std::move(channels), kNumScenes,
                                             FromEnvironment("PEPESEG_GATEWAY_QUERIES", 500));
    absl::SleepFor(absl::Seconds(3));
    return load;
  }
  static void Print(const char* what, const SteadyLoadReport& report) {
    printf(
        "%s: %ld calls in %.1f s, %.0f/s; %ld made twice, %ld failed; p50 %s, p99 %s, longest %s\n",
        what, report.num_calls, absl::ToDoubleSeconds(report.took), report.per_second(),
        report.num_retried, report.num_failed, absl::FormatDuration(report.p50).c_str(),
        absl::FormatDuration(report.p99).c_str(), absl::FormatDuration(report.longest).c_str());
    for (const auto& [reason, count] : report.reasons) printf("  %d x %s\n", count, reason.c_str());
  }

  PostgresqlServer database;
  Fleet fleet;
};

TEST_F(LoadedFleet, AnswersAtASteadyRate) {
  MakeScenes();
  const auto load = StartLoad();
  absl::SleepFor(absl::Seconds(20));
  const SteadyLoadReport report = load->Stop();
  Print("steady", report);
  EXPECT_EQ(report.num_retried, 0);
  EXPECT_EQ(report.num_failed, 0);
}

TEST_F(LoadedFleet, RestartsOneByOneWithoutAFailedCall) {
  MakeScenes();
  const auto load = StartLoad();
  for (int i = 0; i < 3; ++i) {
    const auto end = fleet.StopServer(i);
    ASSERT_TRUE(end.has_value());
    EXPECT_EQ(end->exit_code, 0) << end->description;
    fleet.StartServer(i);
    ASSERT_TRUE(fleet.AwaitServing(3)) << i;
    absl::SleepFor(absl::Seconds(2));
  }
  const SteadyLoadReport report = load->Stop();
  Print("three restarts", report);
  EXPECT_EQ(report.num_failed, 0);
}

TEST_F(LoadedFleet, MovesOnlyTheScenesOfAKilledServer) {
  MakeScenes();
  const auto load = StartLoad();
  const auto before = ServersOf(fleet.ReadLog());
  fleet.KillServer(1);
  absl::SleepFor(absl::Seconds(5));
  const size_t later = fleet.LogSize();
  absl::SleepFor(absl::Seconds(3));
  const SteadyLoadReport report = load->Stop();
  Print("one killed", report);
  EXPECT_LE(report.num_retried, report.num_calls / 1000);
  EXPECT_EQ(report.num_failed, 0);
  int num_moved = 0;
  for (const auto& [scene, server] : ServersOf(fleet.ReadLog(later))) {
    EXPECT_NE(server, "server2") << scene;
    num_moved += server != before.at(scene) ? 1 : 0;
    if (before.at(scene) != "server2") {
      EXPECT_EQ(server, before.at(scene)) << scene;
    }
  }
  printf("%d of %d scenes moved\n", num_moved, kNumScenes);
}

struct FourServers : LoadedFleet {
  FourServers() : LoadedFleet(4) {}
  // Returns the server of each of 1,000 scenes.
  std::map<std::string, std::string> Place() {
    const size_t before = fleet.LogSize();
    const auto channel = fleet.Connect("");
    grpc::GenericStub stub(channel);
    const grpc::Slice nothing("");
    const grpc::ByteBuffer query(&nothing, 1);
    for (int i = 0; i < 1000; ++i) {
      grpc::CompletionQueue queue;
      grpc::ClientContext context;
      context.AddMetadata("x-scene", absl::StrCat("scene-", i));
      const auto call =
          stub.PrepareUnaryCall(&context, "/grpc.health.v1.Health/Check", query, &queue);
      call->StartCall();
      grpc::ByteBuffer answer;
      grpc::Status status;
      call->Finish(&answer, &status, nullptr);
      void* tag = nullptr;
      bool ok = false;
      queue.Next(&tag, &ok);
      EXPECT_OK(status);
    }
    absl::SleepFor(absl::Milliseconds(500));
    return ServersOf(fleet.ReadLog(before));
  }
};

TEST_F(FourServers, MoveOnlyAShareOfScenesToTheFourth) {
  fleet.RestartGateway(3);
  const auto three = Place();
  fleet.RestartGateway(4);
  const auto four = Place();
  ASSERT_EQ(three.size(), 1000u);
  ASSERT_EQ(four.size(), 1000u);
  std::map<std::string, int> shares;
  int num_moved = 0;
  for (const auto& [scene, server] : four) {
    ++shares[server];
    if (server == three.at(scene)) continue;
    ++num_moved;
    EXPECT_EQ(server, "server4") << scene << " moved between servers that stayed";
  }
  printf("%d of 1000 scenes moved; now", num_moved);
  for (const auto& [server, count] : shares) printf(" %s %d", server.c_str(), count);
  printf("\n");
  EXPECT_LE(num_moved, 300);
}

}  // namespace
}  // namespace pepeseg::testing
