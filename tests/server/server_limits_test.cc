// Health of a whole server, and limits that it puts on clients.
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <future>
#include <set>

#include "absl/time/clock.h"
#include "tests/server/health_check.h"
#include "tests/server/running_server.h"
#include "tests/server/store/test_database.h"
#include "tests/testing/eventually.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

const std::vector<std::string> kServices = {
    "pepeseg.v1.SceneService",        "pepeseg.v1.DatasetService",   "pepeseg.v1.JobService",
    "pepeseg.v1.SegmentationService", "pepeseg.v1.LabelService",     "pepeseg.v1.SelectionService",
    "pepeseg.v1.RenderService",       "pepeseg.v1.EvaluationService"};

TEST(ServerHealth, IsReportedForEachService) {
  RunningServer running(PEPESEG_FAKE_WORKER);
  const auto channel = ConnectTo(running.server->port());
  EXPECT_EQ(CheckHealth(channel, ""), 1);
  for (const std::string& service : kServices) {
    EXPECT_EQ(CheckHealth(channel, service), 1) << service;
  }
  EXPECT_EQ(CheckHealth(channel, "pepeseg.v1.NoSuchService"), -1);
}

grpc::Status CreateScene(const std::shared_ptr<grpc::Channel>& channel, const std::string& id,
                         size_t metadata_bytes) {
  grpc::ClientContext context;
  context.AddMetadata("x-long", std::string(metadata_bytes, 'x'));
  v1::CreateSceneRequest request;
  request.set_scene_id(id);
  return CallWith(context, channel, &SceneStub::CreateScene, request);
}

TEST(ServerLimits, ApplyToTheSocket) {
  RunningServer running(PEPESEG_FAKE_WORKER);
  const int port = running.server->port();
  const std::string large(size_t{9} << 20, 'x');
  EXPECT_ERROR(CreateScene(ConnectTo(port), large, 0), grpc::RESOURCE_EXHAUSTED);
  // gRPC closes the whole connection for that; other connections are not affected.
  const auto other = ConnectTo(port);
  EXPECT_OK(CreateScene(other, "a", 10'000));
  EXPECT_FALSE(CreateScene(ConnectTo(port), "b", 20'000).ok());
  EXPECT_OK(CreateScene(other, "c", 0));
}

// Without its database, no service can be served.
TEST(ServerHealth, FollowsTheDatabase) {
  testing::PostgresqlServer database;
  ServerOptions options;
  options.database = database.NewDatabase();
  RunningServer running(PEPESEG_FAKE_WORKER, options);
  const auto channel = ConnectTo(running.server->port());
  const auto await = [&](int want) {
    // The health monitor probes every two seconds.
    EXPECT_TRUE(
        testing::Eventually([&] { return CheckHealth(channel, "") == want; }, absl::Seconds(15)));
    for (const std::string& service : kServices) {
      EXPECT_EQ(CheckHealth(channel, service), want) << service;
    }
  };
  await(kServing);
  database.Crash();
  await(kNotServing);
  EXPECT_ERROR(CreateScene(channel, "away", 0), grpc::UNAVAILABLE);
  database.Restart();
  await(kServing);
  EXPECT_OK(CreateScene(channel, "back", 0));
}

// Calls move to a new connection. A stream may stay on the old one for the same time again.
TEST(ServerLimits, EndOldConnectionsWithoutFailedCalls) {
  ServerOptions options;
  options.max_connection_age = absl::Seconds(2);
  RunningServer running(PEPESEG_FAKE_WORKER, options);
  running.CreateScene("a");
  const std::string job = running.Train("a", "hang").name();
  const auto channel = ConnectTo(running.server->port());
  const auto jobs = v1::JobService::NewStub(channel);
  grpc::ClientContext watching;
  const auto stream = jobs->WatchJob(&watching, Named{job});
  v1::JobEvent event;
  ASSERT_TRUE(stream->Read(&event));
  // The channel leaves READY only for a moment when the server sends GOAWAY, which polling would
  // miss.
  const absl::Time end = absl::Now() + absl::Seconds(3);
  std::future<bool> aged = std::async(std::launch::async, [&] {
    return channel->WaitForStateChange(GRPC_CHANNEL_READY, absl::ToChronoTime(end));
  });
  while (absl::Now() < end) {
    grpc::ClientContext context;
    context.set_wait_for_ready(true);
    EXPECT_OK(CallWith(context, channel, &JobStub::GetJob, Named{job}));
    absl::SleepFor(absl::Milliseconds(1));
  }
  EXPECT_TRUE(aged.get()) << "the connection did not age";
  // The stream still works: it gets the event of the cancelled job.
  ASSERT_OK(CallOver(channel, &JobStub::CancelJob, Named{job}));
  while (stream->Read(&event)) {
  }
  EXPECT_OK(stream->Finish());
  EXPECT_EQ(event.state_changed().state(), v1::JOB_STATE_CANCELLED);
}

}  // namespace
}  // namespace pepeseg
