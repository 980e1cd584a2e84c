// What is left in the server of calls that are cancelled or not read.
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <memory>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "server/observe/process_use.h"
#include "tests/server/health_check.h"
#include "tests/system/stress/load.h"
#include "tests/system/stress/load_calls.h"
#include "tests/testing/eventually.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {

CancelsReport RunCancels(LoadedServer& server, int num_calls) {
  constexpr int kAtATime = 100;
  const auto channel = ConnectTo(server.running.server->port());
  const auto jobs = v1::JobService::NewStub(channel);
  const auto asking = v1::SegmentationService::NewStub(channel);
  const v1::ProposeScalesRequest query = LongQuery();
  CancelsReport report;
  while (report.num_cancelled < num_calls) {
    // The first rounds fill caches of gRPC and the allocator.
    if (report.num_cancelled <= num_calls / 5) report.rss_before = MeasureProcess().resident_bytes;
    std::atomic<int> num_open = 0;
    Calls calls;
    std::vector<std::unique_ptr<Watcher>> watchers;
    for (int i = 0; i < kAtATime / 2; ++i) {
      watchers.push_back(std::make_unique<Watcher>(*jobs, server.idle_job, num_open));
      calls.Begin<v1::ProposeScalesResponse>([&](auto* context, auto* response, auto done) {
        asking->async()->ProposeScales(context, &query, response, std::move(done));
        context->TryCancel();
      });
      if (i % 2 == 0) watchers.back()->Cancel();
    }
    for (const auto& watcher : watchers) watcher->Cancel();
    EXPECT_TRUE(testing::Eventually([&] { return num_open == 0; }));
    calls.AwaitAll();
    report.num_cancelled += kAtATime;
  }
  report.num_streams = server.AwaitStreams(0);
  EXPECT_TRUE(testing::Eventually(
      [&] {
        report.calls_in_flight = server.Metric("pepeseg_rpc_calls_in_flight");
        return report.calls_in_flight == 0;
      },
      absl::Seconds(30)));
  report.rss_after = MeasureProcess().resident_bytes;
  return report;
}

namespace {

// Connects with flow-control windows that do not grow. On a slow machine they could hold a whole
// export.
std::shared_ptr<grpc::Channel> ConnectNarrowly(int port) {
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_HTTP2_BDP_PROBE, 0);
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  return grpc::CreateCustomChannel(absl::StrCat("127.0.0.1:", port),
                                   grpc::InsecureChannelCredentials(), arguments);
}

}  // namespace

UnreadReport RunUnread(LoadedServer& server, int num_streams) {
  const auto channel = ConnectNarrowly(server.running.server->port());
  const auto asking = v1::RenderService::NewStub(channel);
  const auto jobs = v1::JobService::NewStub(channel);
  UnreadReport report;
  report.rss_before = MeasureProcess().resident_bytes;
  v1::ExportGaussiansRequest request;
  request.set_model(kModel);
  v1::WatchJobRequest watch;
  watch.set_name(server.idle_job);
  std::vector<std::unique_ptr<grpc::ClientContext>> contexts;
  std::vector<std::unique_ptr<grpc::ClientReader<v1::ExportGaussiansResponse>>> exports;
  std::vector<std::unique_ptr<grpc::ClientReader<v1::JobEvent>>> watchers;
  for (int i = 0; i < num_streams / 2; ++i) {
    contexts.push_back(std::make_unique<grpc::ClientContext>());
    exports.push_back(asking->ExportGaussians(contexts.back().get(), request));
    contexts.push_back(std::make_unique<grpc::ClientContext>());
    watchers.push_back(jobs->WatchJob(contexts.back().get(), watch));
  }
  report.num_streams = server.AwaitStreams(num_streams);
  absl::SleepFor(absl::Seconds(3));  // more than a tick
  report.rss_with = MeasureProcess().resident_bytes;
  for (const auto& context : contexts) context->TryCancel();
  for (const auto& reader : exports) reader->Finish();
  for (const auto& reader : watchers) reader->Finish();
  report.num_streams_after = server.AwaitStreams(0);
  return report;
}

namespace {

// Exports the red square, which is half of the model.
v1::Selection SelectHalf(LoadedServer& server, const std::string& model) {
  v1::CreateSelectionRequest request;
  request.set_model(model);
  *request.mutable_prompt() = SmallQuery().prompt();
  return *server.running.Call(&SelectionStub::CreateSelection, request);
}

double ReservedBytes(LoadedServer& server) {
  return server.Metric("pepeseg_resident_reserved_bytes{device=\"cpu\",memory=\"host\"}");
}

}  // namespace

UnreadExportsReport RunUnreadExports(LoadedServer& server, int num_streams) {
  // Only one job runs at a time.
  EXPECT_OK(server.running.Call(&JobStub::CancelJob, Named{server.idle_job}));
  server.running.CreateScene("large");
  server.running.Await(server.running.Train("large", "large.model").name());
  v1::ExportGaussiansRequest request;
  request.set_model("scenes/large/models/1");
  request.mutable_subset()->set_selection(SelectHalf(server, request.model()).name());
  const auto asking = v1::RenderService::NewStub(ConnectNarrowly(server.running.server->port()));
  UnreadExportsReport report;
  report.rss_before = MeasureProcess().resident_bytes;
  report.reserved_before = ReservedBytes(server);
  std::vector<std::unique_ptr<grpc::ClientContext>> contexts;
  std::vector<std::unique_ptr<grpc::ClientReader<v1::ExportGaussiansResponse>>> exports;
  for (int i = 0; i < num_streams; ++i) {
    contexts.push_back(std::make_unique<grpc::ClientContext>());
    exports.push_back(asking->ExportGaussians(contexts.back().get(), request));
  }
  for (const auto& reader : exports) {
    v1::ExportGaussiansResponse part;
    EXPECT_TRUE(reader->Read(&part));
    report.export_bytes = part.header().num_bytes();
  }
  report.num_streams = server.AwaitStreams(num_streams);
  absl::SleepFor(absl::Seconds(1));
  report.rss_with = MeasureProcess().resident_bytes;
  report.reserved_with = ReservedBytes(server);
  for (const auto& context : contexts) context->TryCancel();
  for (const auto& reader : exports) reader->Finish();
  report.num_streams_after = server.AwaitStreams(0);
  // The memory is released with the stream's object, shortly after the stream is no longer counted.
  EXPECT_TRUE(testing::Eventually(
      [&] {
        report.reserved_after = ReservedBytes(server);
        return report.reserved_after == report.reserved_before;
      },
      absl::Seconds(30)));
  return report;
}

namespace {

// Repeats a call, as clients do, while the first tasks of the streams fill the queue: the server
// then answers UNAVAILABLE with a time to wait.
grpc::Status AskAsPlanned(v1::JobService::Stub& jobs, const std::string& name) {
  const absl::Time deadline = absl::Now() + absl::Seconds(30);
  v1::GetJobRequest request;
  request.set_name(name);
  while (true) {
    grpc::ClientContext context;
    v1::Job job;
    const grpc::Status status = jobs.GetJob(&context, request, &job);
    if (status.ok() || absl::Now() > deadline) return status;
    const v1::Error detail = DetailOf(status);
    if (detail.reason() != "BUSY") return status;
    absl::SleepFor(absl::Seconds(detail.retry_after().seconds()));
  }
}

}  // namespace

CrowdReport RunCrowd(LoadedServer& server, int num_streams) {
  std::atomic<int> num_open = 0;
  std::vector<std::unique_ptr<v1::JobService::Stub>> stubs;
  std::vector<std::unique_ptr<Watcher>> watchers;
  CrowdReport report;
  for (int i = 0; i < num_streams; ++i) {
    if (i % kStreamsPerConnection == 0) {
      stubs.push_back(v1::JobService::NewStub(ConnectTo(server.running.server->port())));
    }
    watchers.push_back(std::make_unique<Watcher>(*stubs.back(), server.idle_job, num_open));
  }
  // Else the stream beyond the limit may be admitted before one of these.
  EXPECT_TRUE(AwaitSnapshots(watchers));
  report.num_streams = server.AwaitStreams(num_streams);
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(30));
  const auto beyond = stubs.front()->WatchJob(&context, Named{server.idle_job});
  v1::JobEvent event;
  while (beyond->Read(&event)) {
  }
  report.beyond = beyond->Finish();
  report.meanwhile = AskAsPlanned(*stubs.front(), server.idle_job);
  for (const auto& watcher : watchers) watcher->Cancel();
  EXPECT_TRUE(testing::Eventually([&] { return num_open == 0; }));
  report.num_streams_after = server.AwaitStreams(0);
  return report;
}

}  // namespace pepeseg
