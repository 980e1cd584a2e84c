#include "server/rpc/worker_pool.h"

#include <gtest/gtest.h>

#include <atomic>
#include <future>

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

}  // namespace
}  // namespace pepeseg
