#include "tests/system/stress/load.h"

#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <atomic>
#include <functional>
#include <memory>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "tests/server/health_check.h"
#include "tests/system/stress/load_calls.h"
#include "tests/testing/eventually.h"
#include "tests/testing/http_get.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

constexpr int kNumWays = 64;

ServerOptions Observed() {
  ServerOptions options;
  options.admin = "127.0.0.1:0";
  options.metrics = "127.0.0.1:0";
  options.streams.max_per_peer = options.streams.max_streams;  // all streams come from this machine
  return options;
}

}  // namespace

LoadedServer::LoadedServer(const std::string& worker) : running(worker, Observed()) {
  running.CreateScene("shelf");
  const v1::Job job = running.Await(running.Train("shelf", "file").name());
  EXPECT_EQ(job.state(), v1::JOB_STATE_SUCCEEDED) << job.DebugString();
  running.CreateScene("idle");
  idle_job = running.Train("idle", "hang").name();
}

v1::ServerStatus LoadedServer::Status() { return *running.Call(&AdminStub::GetServerStatus, {}); }

int LoadedServer::AwaitStreams(int want) {
  int num = -1;
  const auto reached = testing::Eventually([&] { return (num = Status().num_streams()) == want; },
                                           absl::Seconds(30));
  return reached ? want : num;
}

double LoadedServer::Metric(const std::string& name) {
  const std::string text = HttpGet(running.server->metrics_port(), "/metrics");
  const size_t at = text.find(absl::StrCat("\n", name, " "));
  double value = -1;
  if (at == std::string::npos) return value;
  const size_t start = at + name.size() + 2;
  EXPECT_TRUE(absl::SimpleAtod(text.substr(start, text.find('\n', start) - start), &value));
  return value;
}

WatchersReport RunWatchers(LoadedServer& server, int num_watchers, absl::Duration duration) {
  const int port = server.running.server->port();
  const auto asking = v1::SegmentationService::NewStub(ConnectTo(port));
  const v1::SegmentViewsRequest question = Question();
  const auto ask = [&](Calls& calls, const std::function<void(const grpc::Status&)>& next) {
    calls.Begin<v1::SegmentViewsResponse>(
        [&](auto* context, auto* response, auto done) {
          asking->async()->SegmentViews(context, &question, response, std::move(done));
        },
        next);
  };
  AskInTurn(kNumWays, absl::Now() + absl::Seconds(1), ask);  // loads the model
  WatchersReport report;
  const auto without = AskInTurn(kNumWays, absl::Now() + duration, ask);
  report.p99_without = Quantile(TimesOf(without, grpc::OK), 0.99);
  report.num_threads_without = server.Status().num_threads();

  std::atomic<int> num_open = 0;
  std::vector<std::unique_ptr<v1::JobService::Stub>> stubs;
  std::vector<std::unique_ptr<Watcher>> watchers;
  for (int i = 0; i < num_watchers; ++i) {
    if (i % kStreamsPerConnection == 0) stubs.push_back(v1::JobService::NewStub(ConnectTo(port)));
    watchers.push_back(std::make_unique<Watcher>(*stubs.back(), server.idle_job, num_open));
  }
  report.num_streams = server.AwaitStreams(num_watchers);
  const auto with = AskInTurn(kNumWays, absl::Now() + duration, ask);
  report.p99_with = Quantile(TimesOf(with, grpc::OK), 0.99);
  const v1::ServerStatus status = server.Status();
  report.num_threads = status.num_threads();
  for (const auto& pool : status.pools()) report.pool_threads += pool.num_threads();
  report.num_queries = static_cast<int64_t>(without.size() + with.size());
  report.num_failed = report.num_queries - static_cast<int64_t>(TimesOf(without, grpc::OK).size() +
                                                                TimesOf(with, grpc::OK).size());
  for (const auto& watcher : watchers) watcher->Cancel();
  EXPECT_TRUE(testing::Eventually([&] { return num_open == 0; }));
  return report;
}

OverloadReport RunOverload(LoadedServer& server, double factor, absl::Duration duration) {
  const auto asking = v1::SegmentationService::NewStub(ConnectTo(server.running.server->port()));
  const auto other = v1::SegmentationService::NewStub(ConnectTo(server.running.server->port()));
  const v1::ProposeScalesRequest question = LongQuestion();
  std::atomic<int64_t> turn = 0;
  const auto ask = [&](Calls& calls, const std::function<void(const grpc::Status&)>& next) {
    calls.Begin<v1::ProposeScalesResponse>(
        [&](auto* context, auto* response, auto done) {
          // Two connections, since one takes 256 calls at a time.
          auto& stub = turn++ % 2 == 0 ? asking : other;
          stub->async()->ProposeScales(context, &question, response, std::move(done));
        },
        next);
  };
  AskInTurn(8, absl::Now() + absl::Seconds(0.5), ask);
  const double seconds = absl::ToDoubleSeconds(duration);
  OverloadReport report;
  const auto calm = AskInTurn(8, absl::Now() + duration, ask);
  report.peak_per_second = static_cast<double>(TimesOf(calm, grpc::OK).size()) / seconds;

  Calls flood;
  const absl::Time start = absl::Now();
  int64_t num_offered = 0;
  while (absl::Now() < start + duration) {
    const double due = absl::ToDoubleSeconds(absl::Now() - start) * factor * report.peak_per_second;
    while (static_cast<double>(num_offered) < due) {
      ask(flood, {});
      ++num_offered;
    }
    absl::SleepFor(absl::Milliseconds(2));
  }
  // Counts only the answers so far, and not those of calls that are still in the queue.
  const auto answered = flood.TakeOutcomes();
  const double took = absl::ToDoubleSeconds(absl::Now() - start);
  flood.AwaitAll();
  report.offered_per_second = static_cast<double>(num_offered) / took;
  report.goodput_per_second = static_cast<double>(TimesOf(answered, grpc::OK).size()) / took;
  const std::vector<absl::Duration> refused = TimesOf(answered, grpc::UNAVAILABLE);
  report.num_refused = static_cast<int64_t>(refused.size());
  report.num_failed =
      static_cast<int64_t>(answered.size() - refused.size() - TimesOf(answered, grpc::OK).size());
  report.refusal_p50 = Quantile(refused, 0.5);
  for (const Calls::Outcome& outcome : answered) {
    if (outcome.status.ok()) continue;
    report.all_told_when_to_retry &= DetailOf(outcome.status).has_retry_after();
  }
  return report;
}

}  // namespace pepeseg
