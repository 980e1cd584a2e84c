// Health of a whole server, and limits that it puts on clients.
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <future>
#include <set>

#include "absl/time/clock.h"
#include "tests/server/health_check.h"
#include "tests/server/running_server.h"
#include "tests/server/store/test_database.h"

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
  v1::Scene scene;
  return v1::SceneService::NewStub(channel)->CreateScene(&context, request, &scene);
}

TEST(ServerLimits, ApplyToTheSocket) {
  RunningServer running(PEPESEG_FAKE_WORKER);
  const int port = running.server->port();
  const std::string large(size_t{9} << 20, 'x');
  EXPECT_EQ(CreateScene(ConnectTo(port), large, 0).error_code(), grpc::RESOURCE_EXHAUSTED);
  // gRPC closes the whole connection for that; other connections are not affected.
  const auto other = ConnectTo(port);
  EXPECT_TRUE(CreateScene(other, "a", 10'000).ok());
  EXPECT_FALSE(CreateScene(ConnectTo(port), "b", 20'000).ok());
  EXPECT_TRUE(CreateScene(other, "c", 0).ok());
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
    const absl::Time deadline = absl::Now() + absl::Seconds(15);
    while (CheckHealth(channel, "") != want && absl::Now() < deadline) {
      absl::SleepFor(absl::Milliseconds(50));
    }
    EXPECT_EQ(CheckHealth(channel, ""), want);
    for (const std::string& service : kServices) {
      EXPECT_EQ(CheckHealth(channel, service), want) << service;
    }
  };
  await(kServing);
  database.Crash();
  await(kNotServing);
  EXPECT_EQ(CreateScene(channel, "away", 0).error_code(), grpc::UNAVAILABLE);
  database.Restart();
  await(kServing);
  EXPECT_TRUE(CreateScene(channel, "back", 0).ok());
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
  v1::WatchJobRequest watch;
  watch.set_name(job);
  const auto stream = jobs->WatchJob(&watching, watch);
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
    v1::GetJobRequest request;
    request.set_name(job);
    v1::Job answer;
    const grpc::Status status = jobs->GetJob(&context, request, &answer);
    EXPECT_TRUE(status.ok()) << status.error_message();
    absl::SleepFor(absl::Milliseconds(1));
  }
  EXPECT_TRUE(aged.get()) << "the connection did not age";
  // The stream still works: it gets the event of the cancelled job.
  grpc::ClientContext context;
  v1::CancelJobRequest cancel;
  cancel.set_name(job);
  v1::Job cancelled;
  ASSERT_TRUE(jobs->CancelJob(&context, cancel, &cancelled).ok());
  while (stream->Read(&event)) {
  }
  EXPECT_TRUE(stream->Finish().ok());
  EXPECT_EQ(event.state_changed().state(), v1::JOB_STATE_CANCELLED);
}

}  // namespace
}  // namespace pepeseg
