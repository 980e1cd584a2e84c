#include "server/rpc/worker_pool.h"

#include <gtest/gtest.h>

#include <atomic>
#include <future>
#include <thread>
#include <vector>

namespace pepeseg {
namespace {

TEST(WorkerPool, RunsWhatIsQueuedBeforeItStops) {
  std::atomic<int> runs = 0;
  WorkerPool pool(2, 1000);
  for (int i = 0; i < 500; ++i) ASSERT_TRUE(pool.Submit([&] { ++runs; }));
  pool.Stop();
  EXPECT_EQ(runs, 500);
  EXPECT_FALSE(pool.Submit([] {}));
  EXPECT_FALSE(pool.SubmitAlways([] {}));
}

TEST(WorkerPool, RefusesBeyondItsQueue) {
  std::promise<void> gate;
  std::promise<void> begun;
  WorkerPool pool(1, 2);
  ASSERT_TRUE(pool.Submit([&] {
    begun.set_value();
    gate.get_future().wait();
  }));
  begun.get_future().wait();
  EXPECT_TRUE(pool.Submit([] {}));
  EXPECT_TRUE(pool.Submit([] {}));
  EXPECT_FALSE(pool.Submit([] {}));
  std::atomic<bool> ran = false;
  EXPECT_TRUE(pool.SubmitAlways([&] { ran = true; }));
  gate.set_value();
  pool.Stop();
  EXPECT_TRUE(ran);
}

TEST(LatencyWindow, ReportsTheLastTenSecondsWithinTenPercent) {
  LatencyWindow window;
  const absl::Time now = absl::FromUnixSeconds(1'000'000);
  for (int i = 0; i < 980; ++i) window.Record(absl::Milliseconds(20), now - absl::Seconds(1));
  for (int i = 0; i < 20; ++i) window.Record(absl::Seconds(3), now - absl::Seconds(10));
  window.Record(absl::Seconds(100), now - absl::Seconds(11));  // too long ago
  window.Record(absl::Seconds(100), now);                      // in the current second
  const auto told = LatencyWindow::Summarize(now, window);
  EXPECT_DOUBLE_EQ(told.per_second, 100);
  EXPECT_NEAR(absl::ToDoubleMilliseconds(told.p50), 20, 2);
  EXPECT_NEAR(absl::ToDoubleMilliseconds(told.p99), 3000, 300);
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
