#include "tests/system/stress/load.h"

#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "absl/time/clock.h"
#include "server/observe/process_use.h"
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

void LoadedServer::AwaitIdlePools() {
  const auto idle = [&] {
    const v1::ServerStatus status = Status();
    return std::ranges::all_of(
        status.pools(), [](const auto& pool) { return pool.num_busy() + pool.num_queued() == 0; });
  };
  EXPECT_TRUE(testing::Eventually(idle, absl::Seconds(5)));
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

namespace {

// Makes queries for `duration`, kNumWays at a time.
std::vector<Calls::Outcome> SendQueries(v1::SegmentationService::Stub& stub,
                                        absl::Duration duration) {
  const v1::SegmentViewsRequest query = SmallQuery();
  const auto ask = [&](Calls& calls, const std::function<void(const grpc::Status&)>& next) {
    calls.Begin<v1::SegmentViewsResponse>(
        [&](auto* context, auto* response, auto done) {
          stub.async()->SegmentViews(context, &query, response, std::move(done));
        },
        next);
  };
  return AskInTurn(kNumWays, absl::Now() + duration, ask);
}

// Returns the CPU seconds that this process uses in a second, over two ticks of the streams.
double CpuInASecond() {
  constexpr absl::Duration kLong = absl::Seconds(4);
  const absl::Duration before = MeasureProcess().cpu_time;
  absl::SleepFor(kLong);
  return absl::FDivDuration(MeasureProcess().cpu_time - before, kLong);
}

// Returns whether gRPC started a thread with this name.
bool IsOfGrpc(const std::string& name) {
  constexpr absl::string_view kStarts[] = {"default-exec", "resolver-exec",  "event_engine",
                                           "grpc",         "nexting_thread", "timer_manager"};
  return std::any_of(std::begin(kStarts), std::end(kStarts),
                     [&](absl::string_view start) { return absl::StartsWith(name, start); });
}

// Returns the number of threads of this process without those of gRPC.
int NumOwnThreads() {
  int num = 0;
  for (const auto& task : std::filesystem::directory_iterator("/proc/self/task")) {
    std::string name;
    // A thread that ended meanwhile has no name.
    if (std::getline(std::ifstream(task.path() / "comm"), name) && !IsOfGrpc(name)) ++num;
  }
  return num;
}

// Watchers of the idle job, on connections that stay open.
class Watchers {
 public:
  Watchers(LoadedServer& server, int num_watchers) : server_(server), num_watchers_(num_watchers) {
    for (int i = 0; i < num_watchers; i += kStreamsPerConnection) {
      stubs_.push_back(v1::JobService::NewStub(ConnectTo(server.running.server->port())));
    }
  }

  // Opens the watchers, waits until each has its snapshot and the server has nothing else to do for
  // them, and returns the server's streams.
  int Open() {
    for (int i = 0; i < num_watchers_; ++i) {
      v1::JobService::Stub& stub = *stubs_[static_cast<size_t>(i / kStreamsPerConnection)];
      watchers_.push_back(std::make_unique<Watcher>(stub, server_.idle_job, num_open_));
    }
    EXPECT_TRUE(AwaitSnapshots(watchers_));
    const int num_streams = server_.AwaitStreams(num_watchers_);
    server_.AwaitIdlePools();
    return num_streams;
  }
  // Cancels the watchers, and waits until the server has no stream.
  void Close() {
    for (const auto& watcher : watchers_) watcher->Cancel();
    EXPECT_TRUE(testing::Eventually([&] { return num_open_ == 0; }));
    EXPECT_EQ(server_.AwaitStreams(0), 0);
    watchers_.clear();
  }

 private:
  LoadedServer& server_;
  const int num_watchers_;
  std::atomic<int> num_open_ = 0;
  std::vector<std::unique_ptr<v1::JobService::Stub>> stubs_;
  std::vector<std::unique_ptr<Watcher>> watchers_;
};

}  // namespace

WatchersReport RunWatchers(LoadedServer& server, int num_watchers, int num_rounds,
                           absl::Duration phase) {
  const auto asking = v1::SegmentationService::NewStub(ConnectTo(server.running.server->port()));
  WatchersReport report;
  // Makes queries for `phase` and returns the times of their answers.
  const auto ask = [&] {
    const auto outcomes = SendQueries(*asking, phase);
    std::vector<absl::Duration> times = TimesOf(outcomes, grpc::OK);
    report.num_queries += static_cast<int64_t>(outcomes.size());
    report.num_failed += static_cast<int64_t>(outcomes.size() - times.size());
    return times;
  };
  SendQueries(*asking, absl::Seconds(1));  // loads the model
  Watchers watchers(server, num_watchers);
  report.watchers_cpu = -CpuInASecond();
  watchers.Open();
  report.watchers_cpu += CpuInASecond();
  watchers.Close();
  std::vector<absl::Duration> all_without, all_with;
  std::vector<double> ratios;
  for (int round = 0; round < num_rounds; ++round) {
    const std::vector<absl::Duration> without = ask();
    if (round == 0) report.num_threads_without = NumOwnThreads();
    report.num_streams = watchers.Open();
    const std::vector<absl::Duration> with = ask();
    report.num_threads = NumOwnThreads();
    watchers.Close();
    ratios.push_back(absl::FDivDuration(Quantile(with, 0.5), Quantile(without, 0.5)));
    all_without.insert(all_without.end(), without.begin(), without.end());
    all_with.insert(all_with.end(), with.begin(), with.end());
  }
  report.p50_without = Quantile(all_without, 0.5);
  report.p50_with = Quantile(all_with, 0.5);
  report.p50_ratio = Quantile(ratios, 0.5);
  report.p99_without = Quantile(all_without, 0.99);
  report.p99_with = Quantile(all_with, 0.99);
  const v1::ServerStatus status = server.Status();
  for (const auto& pool : status.pools()) report.pool_threads += pool.num_threads();
  return report;
}

OverloadReport RunOverload(LoadedServer& server, double factor, absl::Duration duration) {
  const auto asking = v1::SegmentationService::NewStub(ConnectTo(server.running.server->port()));
  const auto other = v1::SegmentationService::NewStub(ConnectTo(server.running.server->port()));
  const v1::ProposeScalesRequest query = LongQuery();
  std::atomic<int64_t> turn = 0;
  const auto ask = [&](Calls& calls, const std::function<void(const grpc::Status&)>& next) {
    calls.Begin<v1::ProposeScalesResponse>(
        [&](auto* context, auto* response, auto done) {
          // Two connections, since one takes 256 calls at a time.
          auto& stub = turn++ % 2 == 0 ? asking : other;
          stub->async()->ProposeScales(context, &query, response, std::move(done));
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
    report.all_had_a_retry_time &= DetailOf(outcome.status).has_retry_after();
  }
  return report;
}

}  // namespace pepeseg
