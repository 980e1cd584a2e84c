#include "tests/stress/load.h"

#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "server/metrics/process_use.h"
#include "tests/server/rpc/health_check.h"
#include "tests/server/rpc/http_get.h"

namespace pepeseg {
namespace {

constexpr char kModel[] = "scenes/shelf/models/live";
constexpr int kStreamsPerConnection = 200;  // the server's limit is 256
constexpr int kNumWays = 64;

ServerOptions Observed() {
  ServerOptions options;
  options.admin = "127.0.0.1:0";
  options.metrics = "127.0.0.1:0";
  return options;
}

v1::SegmentRequest Question() {
  v1::SegmentRequest request;
  request.set_model(kModel);
  request.mutable_prompt()->mutable_view()->set_view("middle.jpg");
  auto& point = *request.mutable_prompt()->mutable_points()->add_points();
  point.set_x(30);
  point.set_y(32);
  request.mutable_granularity()->set_scale_quantile(0.5);
  request.mutable_granularity()->set_threshold(0.75);
  return request;
}

v1::ProposeScalesRequest LongQuestion() {
  v1::ProposeScalesRequest request;
  request.set_model(kModel);
  *request.mutable_prompt() = Question().prompt();
  return request;
}

absl::Duration Quantile(std::vector<absl::Duration> values, double share) {
  if (values.empty()) return absl::ZeroDuration();
  std::sort(values.begin(), values.end());
  return values[static_cast<size_t>(share * static_cast<double>(values.size() - 1))];
}

// Calls under way, of which none keeps a thread.
class Calls {
 public:
  struct Outcome {
    grpc::Status status;
    absl::Duration took;
  };

  // `start`: begins a call of the kind with its context, answer and callback. `done`: on gRPC's
  // thread.
  template <typename Response, typename Start>
  void Begin(Start start, std::function<void(const grpc::Status&)> done = {}) {
    struct Call {
      grpc::ClientContext context;
      Response response;
    };
    ++num_open_;
    auto call = std::make_shared<Call>();
    const absl::Time begin = absl::Now();
    start(&call->context, &call->response,
          [this, call, begin, done = std::move(done)](const grpc::Status& status) {
            {
              const std::lock_guard lock(mutex_);
              outcomes_.push_back({status, absl::Now() - begin});
            }
            if (done) done(status);
            --num_open_;
          });
  }
  void AwaitAll() const {
    while (num_open_ > 0) absl::SleepFor(absl::Milliseconds(1));
  }
  std::vector<Outcome> TakeOutcomes() {
    const std::lock_guard lock(mutex_);
    return std::exchange(outcomes_, {});
  }

 private:
  std::atomic<int64_t> num_open_ = 0;
  std::mutex mutex_;
  std::vector<Outcome> outcomes_;
};

// `num_ways` questions at a time, each followed by the next until `end`.
template <typename Ask>
std::vector<Calls::Outcome> AskInTurn(int num_ways, absl::Time end, Ask ask) {
  Calls calls;
  std::function<void(const grpc::Status&)> next = [&](const grpc::Status&) {
    if (absl::Now() < end) ask(calls, next);
  };
  for (int i = 0; i < num_ways; ++i) ask(calls, next);
  calls.AwaitAll();
  return calls.TakeOutcomes();
}

// Reads a WatchJob stream until it ends.
class Watcher final : public grpc::ClientReadReactor<v1::JobEvent> {
 public:
  Watcher(v1::JobService::Stub& jobs, const std::string& job, std::atomic<int>& num_open)
      : num_open_(num_open) {
    request_.set_name(job);
    ++num_open_;
    jobs.async()->WatchJob(&context_, &request_, this);
    StartRead(&event_);
    StartCall();
  }
  void Cancel() { context_.TryCancel(); }
  void OnReadDone(bool ok) override {
    if (ok) StartRead(&event_);
  }
  void OnDone(const grpc::Status&) override { --num_open_; }

 private:
  grpc::ClientContext context_;
  v1::WatchJobRequest request_;
  v1::JobEvent event_;
  std::atomic<int>& num_open_;
};

int AwaitStreams(LoadedServer& server, int want) {
  const absl::Time deadline = absl::Now() + absl::Seconds(30);
  while (server.Status().num_streams() != want && absl::Now() < deadline) {
    absl::SleepFor(absl::Milliseconds(20));
  }
  return server.Status().num_streams();
}

std::vector<absl::Duration> TimesOf(const std::vector<Calls::Outcome>& outcomes,
                                    grpc::StatusCode code) {
  std::vector<absl::Duration> times;
  for (const Calls::Outcome& outcome : outcomes) {
    if (outcome.status.error_code() == code) times.push_back(outcome.took);
  }
  return times;
}

}  // namespace

LoadedServer::LoadedServer(const std::string& worker) : running(worker, Observed()) {
  running.CreateScene("shelf");
  const v1::Job job = running.Await(running.Train("shelf", "file").name());
  EXPECT_EQ(job.state(), v1::JOB_STATE_SUCCEEDED) << job.DebugString();
  running.CreateScene("idle");
  idle_job = running.Train("idle", "hang").name();
}

v1::ServerStatus LoadedServer::Status() {
  grpc::ClientContext context;
  v1::ServerStatus status;
  const grpc::Status answer = running.admin->GetStatus(&context, {}, &status);
  EXPECT_TRUE(answer.ok()) << answer.error_message();
  return status;
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
  const v1::SegmentRequest question = Question();
  const auto ask = [&](Calls& calls, const std::function<void(const grpc::Status&)>& next) {
    calls.Begin<v1::SegmentResponse>(
        [&](auto* context, auto* response, auto done) {
          asking->async()->Segment(context, &question, response, std::move(done));
        },
        next);
  };
  AskInTurn(kNumWays, absl::Now() + absl::Seconds(1), ask);  // loads the model
  WatchersReport report;
  const auto without = AskInTurn(kNumWays, absl::Now() + duration, ask);
  report.p99_without = Quantile(TimesOf(without, grpc::OK), 0.99);

  std::atomic<int> num_open = 0;
  std::vector<std::unique_ptr<v1::JobService::Stub>> stubs;
  std::vector<std::unique_ptr<Watcher>> watchers;
  for (int i = 0; i < num_watchers; ++i) {
    if (i % kStreamsPerConnection == 0) stubs.push_back(v1::JobService::NewStub(ConnectTo(port)));
    watchers.push_back(std::make_unique<Watcher>(*stubs.back(), server.idle_job, num_open));
  }
  report.num_streams = AwaitStreams(server, num_watchers);
  const auto with = AskInTurn(kNumWays, absl::Now() + duration, ask);
  report.p99_with = Quantile(TimesOf(with, grpc::OK), 0.99);
  const v1::ServerStatus status = server.Status();
  report.num_threads = status.num_threads();
  for (const auto& pool : status.pools()) report.pool_threads += pool.num_threads();
  report.num_queries = static_cast<int64_t>(without.size() + with.size());
  report.num_failed = report.num_queries - static_cast<int64_t>(TimesOf(without, grpc::OK).size() +
                                                                TimesOf(with, grpc::OK).size());
  for (const auto& watcher : watchers) watcher->Cancel();
  while (num_open > 0) absl::SleepFor(absl::Milliseconds(1));
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
          // Two connections: one takes 256 calls at a time.
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
  // What was answered by now; the queue's rest comes later and does not count.
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

CancelsReport RunCancels(LoadedServer& server, int num_calls) {
  constexpr int kAtATime = 100;
  const auto channel = ConnectTo(server.running.server->port());
  const auto jobs = v1::JobService::NewStub(channel);
  const auto asking = v1::SegmentationService::NewStub(channel);
  const v1::ProposeScalesRequest question = LongQuestion();
  CancelsReport report;
  while (report.num_cancelled < num_calls) {
    // The first rounds fill what gRPC and the allocator keep.
    if (report.num_cancelled <= num_calls / 5) report.rss_before = MeasureProcess().resident_bytes;
    std::atomic<int> num_open = 0;
    Calls calls;
    std::vector<std::unique_ptr<Watcher>> watchers;
    for (int i = 0; i < kAtATime / 2; ++i) {
      watchers.push_back(std::make_unique<Watcher>(*jobs, server.idle_job, num_open));
      calls.Begin<v1::ProposeScalesResponse>([&](auto* context, auto* response, auto done) {
        asking->async()->ProposeScales(context, &question, response, std::move(done));
        context->TryCancel();
      });
      if (i % 2 == 0) watchers.back()->Cancel();
    }
    for (const auto& watcher : watchers) watcher->Cancel();
    while (num_open > 0) absl::SleepFor(absl::Microseconds(100));
    calls.AwaitAll();
    report.num_cancelled += kAtATime;
  }
  report.num_streams = AwaitStreams(server, 0);
  const absl::Time deadline = absl::Now() + absl::Seconds(30);
  do {
    report.calls_in_flight = server.Metric("pepeseg_rpc_calls_in_flight");
  } while (report.calls_in_flight != 0 && absl::Now() < deadline);
  report.rss_after = MeasureProcess().resident_bytes;
  return report;
}

UnreadReport RunUnread(LoadedServer& server, int num_streams) {
  const auto channel = ConnectTo(server.running.server->port());
  const auto asking = v1::SegmentationService::NewStub(channel);
  const auto jobs = v1::JobService::NewStub(channel);
  UnreadReport report;
  report.rss_before = MeasureProcess().resident_bytes;
  v1::ExportSelectionRequest request;
  request.set_model(kModel);
  v1::WatchJobRequest watch;
  watch.set_name(server.idle_job);
  std::vector<std::unique_ptr<grpc::ClientContext>> contexts;
  std::vector<std::unique_ptr<grpc::ClientReader<v1::ExportSelectionResponse>>> exports;
  std::vector<std::unique_ptr<grpc::ClientReader<v1::JobEvent>>> watchers;
  for (int i = 0; i < num_streams / 2; ++i) {
    contexts.push_back(std::make_unique<grpc::ClientContext>());
    exports.push_back(asking->ExportSelection(contexts.back().get(), request));
    contexts.push_back(std::make_unique<grpc::ClientContext>());
    watchers.push_back(jobs->WatchJob(contexts.back().get(), watch));
  }
  report.num_streams = AwaitStreams(server, num_streams);
  absl::SleepFor(absl::Seconds(3));  // more than a tick
  report.rss_with = MeasureProcess().resident_bytes;
  for (const auto& context : contexts) context->TryCancel();
  for (const auto& reader : exports) reader->Finish();
  for (const auto& reader : watchers) reader->Finish();
  report.num_streams_after = AwaitStreams(server, 0);
  return report;
}

}  // namespace pepeseg
