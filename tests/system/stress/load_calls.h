#pragma once

#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "absl/time/clock.h"
#include "pepeseg/v1/job_service.grpc.pb.h"
#include "pepeseg/v1/segmentation_service.grpc.pb.h"
#include "tests/testing/eventually.h"

// Calls of the runs in load.h.
namespace pepeseg {

inline constexpr char kModel[] = "scenes/shelf/models/live";

inline v1::SegmentViewsRequest SmallQuery() {
  v1::SegmentViewsRequest request;
  request.set_model(kModel);
  request.mutable_prompt()->mutable_view()->set_view("middle.jpg");
  auto& point = *request.mutable_prompt()->mutable_points()->add_points();
  point.set_x(30);
  point.set_y(32);
  request.mutable_granularity()->set_scale_quantile(0.5);
  request.mutable_granularity()->set_threshold(0.75);
  return request;
}

inline v1::ProposeScalesRequest LongQuery() {
  v1::ProposeScalesRequest request;
  request.set_model(kModel);
  *request.mutable_prompt() = SmallQuery().prompt();
  return request;
}

template <typename T>
T Quantile(std::vector<T> values, double share) {
  if (values.empty()) return T();
  std::sort(values.begin(), values.end());
  return values[static_cast<size_t>(share * static_cast<double>(values.size() - 1))];
}

// Asynchronous calls in progress. None occupies a thread.
class Calls {
 public:
  struct Outcome {
    grpc::Status status;
    absl::Duration took;
  };

  // `start` begins a call of the kind with its context, answer and callback. `done` is called on a
  // thread of gRPC.
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
    EXPECT_TRUE(testing::Eventually([this] { return num_open_ == 0; }, absl::Minutes(5)));
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

// Makes queries until `end`, `num_ways` at a time.
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
  // Returns whether the first message, the snapshot, has come.
  bool started() const { return started_; }
  void OnReadDone(bool ok) override {
    if (!ok) return;
    started_ = true;
    StartRead(&event_);
  }
  void OnDone(const grpc::Status&) override { --num_open_; }

 private:
  grpc::ClientContext context_;
  v1::WatchJobRequest request_;
  v1::JobEvent event_;
  std::atomic<bool> started_ = false;
  std::atomic<int>& num_open_;
};

// Waits until each watcher has its snapshot: the server has then admitted its stream. A stream is
// counted earlier, when its call begins.
inline ::testing::AssertionResult AwaitSnapshots(
    const std::vector<std::unique_ptr<Watcher>>& watchers) {
  const auto all_started = [&] {
    return std::ranges::all_of(watchers, [](const auto& watcher) { return watcher->started(); });
  };
  return testing::Eventually(all_started);
}

inline std::vector<absl::Duration> TimesOf(const std::vector<Calls::Outcome>& outcomes,
                                           grpc::StatusCode code) {
  std::vector<absl::Duration> times;
  for (const Calls::Outcome& outcome : outcomes) {
    if (outcome.status.error_code() == code) times.push_back(outcome.took);
  }
  return times;
}

}  // namespace pepeseg
