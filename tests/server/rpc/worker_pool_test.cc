#include "server/rpc/worker_pool.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <functional>
#include <future>
#include <string>
#include <thread>
#include <vector>

namespace pepeseg {
namespace {

TEST(WorkerPool, RunsWhatIsQueuedBeforeItStops) {
  std::atomic<int> runs = 0;
  WorkerPool pool({.threads = 2, .queued = 1000});
  for (int i = 0; i < 500; ++i) ASSERT_TRUE(pool.Submit("a", [&] { ++runs; }));
  pool.Stop();
  EXPECT_EQ(runs, 500);
  EXPECT_FALSE(pool.Submit("a", [] {}));
  EXPECT_FALSE(pool.SubmitAlways("a", [] {}));
}

TEST(WorkerPool, RefusesBeyondItsQueue) {
  std::promise<void> gate;
  std::promise<void> begun;
  WorkerPool pool({.threads = 1, .queued = 2});
  ASSERT_TRUE(pool.Submit("a", [&] {
    begun.set_value();
    gate.get_future().wait();
  }));
  begun.get_future().wait();
  EXPECT_TRUE(pool.Submit("a", [] {}));
  EXPECT_TRUE(pool.Submit("a", [] {}));
  EXPECT_FALSE(pool.Submit("a", [] {}));
  std::atomic<bool> ran = false;
  EXPECT_TRUE(pool.SubmitAlways("a", [&] { ran = true; }));
  gate.set_value();
  pool.Stop();
  EXPECT_TRUE(ran);
}

// Holds the only thread of a pool until Open() is called.
class Gate {
 public:
  explicit Gate(WorkerPool& pool) {
    std::promise<void> begun;
    EXPECT_TRUE(pool.Submit("gate", [&] {
      begun.set_value();
      opened_.get_future().wait();
    }));
    begun.get_future().wait();
  }
  void Open() { opened_.set_value(); }

 private:
  std::promise<void> opened_;
};

TEST(WorkerPool, ServesOwnersInTurn) {
  WorkerPool pool({.threads = 1, .queued = 100});
  Gate gate(pool);
  std::string order;
  for (int i = 0; i < 4; ++i) ASSERT_TRUE(pool.Submit("a", [&] { order += 'a'; }));
  for (int i = 0; i < 2; ++i) ASSERT_TRUE(pool.Submit("b", [&] { order += 'b'; }));
  ASSERT_TRUE(pool.Submit("c", [&] { order += 'c'; }));
  gate.Open();
  pool.Stop();
  EXPECT_EQ(order, "abcabaa");
}

// A long answer submits its next part when one has ended.
TEST(WorkerPool, LetsATaskWaitForOnePartOfALongAnswer) {
  WorkerPool pool({.threads = 1, .queued = 100});
  Gate gate(pool);
  std::string order;
  std::function<void()> part = [&] {
    order += 'a';
    if (order.size() < 10) pool.SubmitAlways("a", part);
  };
  ASSERT_TRUE(pool.Submit("a", part));
  ASSERT_TRUE(pool.Submit("b", [&] { order += 'b'; }));
  ASSERT_TRUE(pool.Submit("a", [&] { order += 'x'; }));
  gate.Open();
  while (pool.use().num_queued > 0 || pool.use().num_busy > 0) std::this_thread::yield();
  pool.Stop();
  EXPECT_EQ(order.substr(0, 4), "abxa") << order;
}

TEST(WorkerPool, KeepsPlacesOfItsQueueForOtherOwners) {
  WorkerPool pool({.threads = 1, .queued = 4, .queued_of_owner = 2});
  Gate gate(pool);
  EXPECT_TRUE(pool.Submit("a", [] {}));
  EXPECT_TRUE(pool.Submit("a", [] {}));
  EXPECT_FALSE(pool.Submit("a", [] {}));
  EXPECT_TRUE(pool.Submit("b", [] {}));
  EXPECT_TRUE(pool.Submit("c", [] {}));
  EXPECT_FALSE(pool.Submit("d", [] {}));
  EXPECT_EQ(pool.use().num_refused, 2);
  gate.Open();
}

TEST(WorkerPool, KeepsThreadsForOtherOwners) {
  WorkerPool pool({.threads = 2, .queued = 100, .threads_of_owner = 1});
  std::promise<void> gate;
  std::shared_future<void> opened = gate.get_future().share();
  std::atomic<int> running = 0;
  std::atomic<int> most = 0;
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(pool.Submit("a", [&, opened] {
      most = std::max<int>(most, ++running);
      opened.wait();
      --running;
    }));
  }
  // The second thread is free for another owner, although two tasks of the first one wait.
  std::promise<void> done;
  ASSERT_TRUE(pool.Submit("b", [&] { done.set_value(); }));
  EXPECT_EQ(done.get_future().wait_for(std::chrono::seconds(60)), std::future_status::ready);
  gate.set_value();
  pool.Stop();
  EXPECT_EQ(most, 1);
}

TEST(LatencyWindow, ReportsTheLastTenSecondsWithinTenPercent) {
  LatencyWindow window;
  const absl::Time now = absl::FromUnixSeconds(1'000'000);
  for (int i = 0; i < 980; ++i) window.Record(absl::Milliseconds(20), now - absl::Seconds(1));
  for (int i = 0; i < 20; ++i) window.Record(absl::Seconds(3), now - absl::Seconds(10));
  window.Record(absl::Seconds(100), now - absl::Seconds(11));  // too long ago
  window.Record(absl::Seconds(100), now);                      // in the current second
  const auto reported = LatencyWindow::Summarize(now, window);
  EXPECT_DOUBLE_EQ(reported.per_second, 100);
  EXPECT_NEAR(absl::ToDoubleMilliseconds(reported.p50), 20, 2);
  EXPECT_NEAR(absl::ToDoubleMilliseconds(reported.p99), 3000, 300);
  EXPECT_EQ(LatencyWindow::Summarize(now + absl::Minutes(1), window).per_second, 0);
}

TEST(LatencyWindow, CountsRecordsOfAllThreads) {
  LatencyWindow window, other;
  const absl::Time now = absl::FromUnixSeconds(1'000'000);
  window.Record(absl::Milliseconds(1), now - absl::Seconds(12));  // an old count in the same slot
  std::vector<std::thread> threads;
  threads.reserve(4);
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&] {
      for (int i = 0; i < 10'000; ++i) window.Record(absl::Milliseconds(1), now - absl::Seconds(1));
    });
  }
  for (std::thread& thread : threads) thread.join();
  other.Record(absl::Milliseconds(1), now - absl::Seconds(2));
  EXPECT_DOUBLE_EQ(LatencyWindow::Summarize(now, window, other).per_second, 4000.1);
}

}  // namespace
}  // namespace pepeseg
