// Observing a server: metrics, request ids, traces, status, draining, health.
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <future>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "server/observe/log.h"
#include "server/worker_protocol/job_folder.h"
#include "tests/server/health_check.h"
#include "tests/server/service_test.h"
#include "tests/testing/http_get.h"

namespace pepeseg {
namespace {

ServerOptions Watched() {
  ServerOptions options;
  options.admin = "127.0.0.1:0";
  options.metrics = "127.0.0.1:0";
  return options;
}

struct ObserveTest : ServiceTest {
  ObserveTest() : ServiceTest(PEPESEG_MODEL_WORKER, Watched()) {}

  grpc::Status GetScene(const std::string& name) { return Call(&SceneStub::GetScene, Named{name}); }
  v1::ServerStatus Status() { return *Call(&AdminStub::GetServerStatus, {}); }
  v1::ServerStatus Drain() { return *Call(&AdminStub::DrainServer, {}); }
  v1::ServerStatus Resume() { return *Call(&AdminStub::ResumeServer, {}); }
  bool Exposes(const std::string& line) {
    const std::string metrics = HttpGet(running.server->metrics_port(), "/metrics");
    return metrics.find("\n" + line) != std::string::npos;
  }
  // A client gets its response a moment before the call has ended on the server.
  ::testing::AssertionResult ExposesSoon(const std::string& line) {
    return Eventually([&] { return Exposes(line); });
  }
  std::string EchoOf(const std::string& request_id) {
    grpc::ClientContext context;
    if (!request_id.empty()) context.AddMetadata("x-request-id", request_id);
    EXPECT_ERROR(CallWith(context, running.channel, &SceneStub::GetScene, Named{"scenes/none"}),
                 grpc::NOT_FOUND);
    const auto& metadata = context.GetServerInitialMetadata();
    EXPECT_EQ(metadata.count("x-request-id"), 1);
    const auto found = metadata.find("x-request-id");
    return found == metadata.end() ? "" : std::string(found->second.data(), found->second.size());
  }
};

TEST_F(ObserveTest, MetricsCountCallsByKnownMethodsOnly) {
  running.CreateScene("shelf");
  EXPECT_ERROR(GetScene("scenes/none"), grpc::NOT_FOUND);
  EXPECT_ERROR(GetScene("scenes/none"), grpc::NOT_FOUND);
  EXPECT_TRUE(
      Exposes("pepeseg_rpc_calls_total{code=\"NOT_FOUND\",method=\"SceneService/GetScene\"} 2") ||
      Exposes("pepeseg_rpc_calls_total{method=\"SceneService/GetScene\",code=\"NOT_FOUND\"} 2"))
      << HttpGet(running.server->metrics_port(), "/metrics");
  EXPECT_TRUE(Exposes("pepeseg_rpc_duration_seconds_count{method=\"SceneService/GetScene\"} 2"));
  EXPECT_TRUE(ExposesSoon("pepeseg_rpc_calls_in_flight 0"));
  EXPECT_TRUE(Exposes("pepeseg_scenes 1"));
  EXPECT_TRUE(Exposes("pepeseg_jobs{state=\"running\"} 0"));
  EXPECT_TRUE(Exposes("pepeseg_pool_busy_threads{pool=\"query\"} 0"));
  EXPECT_TRUE(Exposes("pepeseg_process_threads "));
  // A method that does not exist.
  const auto elsewhere = v1::AdminService::NewStub(running.channel);
  grpc::ClientContext context;
  v1::ServerStatus status;
  EXPECT_ERROR(elsewhere->GetServerStatus(&context, {}, &status), grpc::UNIMPLEMENTED);
  EXPECT_EQ(HttpGet(running.server->metrics_port(), "/metrics").find("made"), std::string::npos);
}

TEST_F(ObserveTest, MetricsReportModelsInMemoryAndTheirMaps) {
  running.CreateScene("shelf");
  ASSERT_EQ(running.Await(running.Train("shelf", "file").name()).state(), v1::JOB_STATE_SUCCEEDED);
  EXPECT_TRUE(Exposes("pepeseg_models 1"));
  for (int i = 0; i < 2; ++i) {
    v1::SegmentViewsRequest request;
    request.set_model("scenes/shelf/models/live");
    request.mutable_prompt()->mutable_view()->set_view("middle.jpg");
    auto& point = *request.mutable_prompt()->mutable_points()->add_points();
    point.set_x(30);
    point.set_y(32);
    ASSERT_OK(Call(&SegmentationStub::SegmentViews, request));
  }
  EXPECT_TRUE(Exposes("pepeseg_resident_models{device=\"cpu\"} 1"));
  EXPECT_TRUE(Exposes("pepeseg_model_loads_total{device=\"cpu\"} 1"));
  EXPECT_TRUE(Exposes("pepeseg_feature_map_renders_total 1"));
  EXPECT_FALSE(Exposes("pepeseg_feature_map_hits_total 0"));
  EXPECT_TRUE(Exposes("pepeseg_jobs{state=\"succeeded\"} 1"));
  absl::SleepFor(absl::Seconds(1.1));  // the window has whole seconds only
  EXPECT_NEAR(Status().queries_per_second(), 0.2, 1e-9);
  EXPECT_GT(Status().query_p99().nanos(), 0);
}

TEST_F(ObserveTest, SkipsACallWhoseDeadlinePassesInTheQueue) {
  running.CreateScene("shelf");
  ASSERT_EQ(running.Await(running.Train("shelf", "file").name()).state(), v1::JOB_STATE_SUCCEEDED);
  v1::ProposeScalesRequest slow;
  slow.set_model("scenes/shelf/models/live");
  slow.mutable_prompt()->mutable_view()->set_view("middle.jpg");
  auto& point = *slow.mutable_prompt()->mutable_points()->add_points();
  point.set_x(30);
  point.set_y(32);
  std::vector<std::future<grpc::Status>> before;
  for (int i = 0; i < 90; ++i) {
    before.push_back(std::async(std::launch::async, [&]() -> grpc::Status {
      return Call(&SegmentationStub::ProposeScales, slow);
    }));
  }
  ASSERT_TRUE(Eventually([&] { return Status().pools(1).num_queued() >= 40; }));
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + std::chrono::milliseconds(5));
  v1::RenderViewRequest request;
  request.set_model(slow.model());
  request.mutable_viewpoint()->set_view("middle.jpg");
  EXPECT_ERROR(CallWith(context, running.channel, &RenderStub::RenderView, request),
               grpc::DEADLINE_EXCEEDED);
  for (auto& call : before) EXPECT_OK(call.get());
  const std::string metrics = HttpGet(running.server->metrics_port(), "/metrics");
  EXPECT_EQ(metrics.find("method=\"RenderService/RenderView\",code=\"OK\""), std::string::npos);
  EXPECT_EQ(metrics.find("code=\"OK\",method=\"RenderService/RenderView\""), std::string::npos);
  EXPECT_TRUE(Exposes("pepeseg_rpc_duration_seconds_count{method=\"RenderService/RenderView\"} 1"));
}

TEST_F(ObserveTest, MetricsBeyondThisMachineNeedInsecure) {
  ServerOptions options = running.options;
  options.data = running.folder / "other";
  options.admin.clear();
  options.metrics = "0.0.0.0:0";
  EXPECT_STATUS(Server::Start(options), absl::StatusCode::kFailedPrecondition, "");
  options.metrics = absl::StrCat("127.0.0.1:", running.server->metrics_port());
  EXPECT_STATUS(Server::Start(options), absl::StatusCode::kUnavailable, "");
  options.metrics = "unix:/nowhere";
  EXPECT_STATUS(Server::Start(options), absl::StatusCode::kInvalidArgument, "");
}

TEST_F(ObserveTest, ReturnsOrMakesRequestIds) {
  EXPECT_EQ(EchoOf("order-66"), "order-66");
  const std::string made = EchoOf("");
  EXPECT_TRUE(IsRequestId(made)) << made;
  EXPECT_NE(EchoOf(""), made);
  EXPECT_NE(EchoOf("no spaces please"), "no spaces please");
  EXPECT_NE(EchoOf(std::string(65, 'x')), std::string(65, 'x'));
}

TEST_F(ObserveTest, JobKeepsTheTraceOfTheCallThatMadeIt) {
  constexpr char kTrace[] = "4bf92f3577b34da6a3ce929d0e0e4736";
  running.CreateScene("shelf");
  const std::string dataset = running.UploadAndSeal("shelf", {{"file", "bytes"}});
  v1::TrainSceneRequest request;
  request.set_scene("scenes/shelf");
  request.set_dataset(dataset);
  grpc::ClientContext context;
  context.AddMetadata("traceparent", absl::StrCat("00-", kTrace, "-00f067aa0ba902b7-01"));
  ASSERT_OK_AND_ASSIGN(const v1::Job job,
                       CallWith(context, running.channel, &JobStub::TrainScene, request));
  running.Await(job.name());
  ASSERT_OK_AND_ASSIGN(const auto spec, JobFolder(running.options.data / job.name()).ReadSpec(1));
  const auto trace = ParseTraceparent(spec.traceparent);
  ASSERT_TRUE(trace.has_value()) << spec.traceparent;
  EXPECT_EQ(trace->trace_id, kTrace);
  EXPECT_EQ(trace->flags, "01");
  EXPECT_NE(trace->parent_id, "00f067aa0ba902b7");
}

TEST_F(ObserveTest, StatusReportsWhatTheServerDoes) {
  running.CreateScene("shelf");
  const v1::Job job = running.Train("shelf", "hang");
  grpc::ClientContext context;
  const auto watcher = running.jobs->WatchJob(&context, Named{job.name()});
  v1::JobEvent event;
  ASSERT_TRUE(watcher->Read(&event));
  v1::ServerStatus status;
  ASSERT_TRUE(Eventually([&] { return (status = Status()).running_jobs_size() > 0; }));
  EXPECT_EQ(status.running_jobs(0).name(), job.name());
  EXPECT_EQ(status.num_streams(), 1);
  EXPECT_EQ(status.pools_size(), 7);
  EXPECT_EQ(status.pools(1).work(), v1::ServerStatus::WORK_QUERY);
  EXPECT_EQ(status.pools(1).num_threads(), 2);
  EXPECT_GT(status.resident_bytes(), 1 << 20);
  EXPECT_GT(status.num_threads(), 10);
  EXPECT_GT(status.num_descriptors(), 10);
  EXPECT_GT(status.disk_free_bytes(), 0);
  EXPECT_FALSE(status.draining());
  EXPECT_EQ(status.device().substr(0, 3), "cpu");
  context.TryCancel();
}

TEST_F(ObserveTest, DrainingRefusesNewWorkUntilTheServerResumes) {
  running.CreateScene("shelf");
  const v1::Job job = running.Train("shelf", "hang");
  grpc::ClientContext old_context;
  v1::WatchJobRequest watch;
  watch.set_name(job.name());
  const auto watcher = running.jobs->WatchJob(&old_context, watch);
  v1::JobEvent event;
  ASSERT_TRUE(watcher->Read(&event));
  const auto socket = ConnectTo(running.server->port());
  EXPECT_TRUE(Drain().draining());
  EXPECT_EQ(CheckHealth(socket, ""), kNotServing);
  EXPECT_EQ(CheckHealth(socket, "pepeseg.v1.RenderService"), kNotServing);
  const grpc::Status refused = GetScene("scenes/shelf");
  EXPECT_ERROR(refused, grpc::UNAVAILABLE, {.reason = "DRAINING"});
  EXPECT_TRUE(DetailOf(refused).has_retry_after());
  grpc::ClientContext new_context;
  const auto late = running.jobs->WatchJob(&new_context, watch);
  EXPECT_FALSE(late->Read(&event));
  EXPECT_ERROR(late->Finish(), grpc::UNAVAILABLE);
  // The old stream continues. The client learns of the other's end before it has ended on the
  // server.
  EXPECT_TRUE(Eventually([&] { return Status().num_streams() == 1; }));
  EXPECT_TRUE(Exposes("pepeseg_draining 1"));
  EXPECT_FALSE(Resume().draining());
  EXPECT_OK(GetScene("scenes/shelf"));
  EXPECT_EQ(CheckHealth(socket, ""), kServing);
  old_context.TryCancel();
}

TEST_F(ObserveTest, MissingDataDirectoryStopsUploadsButNotQueries) {
  const auto socket = ConnectTo(running.server->port());
  const auto await = [&](const char* service, int health) {
    return Eventually([&] { return CheckHealth(socket, service) == health; }, absl::Seconds(10));
  };
  EXPECT_TRUE(await("pepeseg.v1.DatasetService", kServing));
  std::filesystem::path away = running.options.data;
  away += ".away";
  std::filesystem::rename(running.options.data, away);
  EXPECT_TRUE(await("pepeseg.v1.DatasetService", kNotServing));
  EXPECT_TRUE(await("pepeseg.v1.JobService", kNotServing));
  EXPECT_EQ(CheckHealth(socket, "pepeseg.v1.SegmentationService"), kServing);
  EXPECT_EQ(CheckHealth(socket, ""), kServing);
  std::filesystem::rename(away, running.options.data);
  EXPECT_TRUE(await("pepeseg.v1.DatasetService", kServing));
}

TEST_F(ObserveTest, StoppingServerStillAnswersWhileItWaitsForTheGateway) {
  running.options.drain = absl::Seconds(1);
  running.Restart();
  running.CreateScene("shelf");
  const auto socket = ConnectTo(running.server->port());
  EXPECT_EQ(CheckHealth(socket, ""), kServing);
  auto stopping = std::async(std::launch::async,
                             [&] { running.server->Shutdown(absl::Now() + absl::Seconds(20)); });
  ASSERT_TRUE(Eventually([&] { return CheckHealth(socket, "") != kServing; }));
  EXPECT_OK(GetScene("scenes/shelf"));
  stopping.wait();
}

}  // namespace
}  // namespace pepeseg
