#include "server/worker_protocol/heartbeat.h"

#include <gtest/gtest.h>

#include <atomic>

#include "absl/time/clock.h"
#include "tests/testing/eventually.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

using std::chrono::milliseconds;

TEST(HeartbeatWatch, MeasuresTimeSinceTheLastChange) {
  const testing::TempFolder folder;
  HeartbeatWatch watch(folder / "heartbeat");
  EXPECT_EQ(watch.SinceChange(), milliseconds(0));
  absl::SleepFor(absl::Milliseconds(30));
  EXPECT_EQ(watch.SinceChange(), milliseconds(0));  // the file has never existed
  ASSERT_TRUE(Touch(folder / "heartbeat"));
  watch.SinceChange();
  absl::SleepFor(absl::Milliseconds(50));
  EXPECT_GE(watch.SinceChange(), milliseconds(50));
  ASSERT_TRUE(Touch(folder / "heartbeat"));
  EXPECT_EQ(watch.SinceChange(), milliseconds(0));  // seen just now
}

TEST(HeartbeatWatch, CannotTouchAFileInAMissingFolder) { EXPECT_FALSE(Touch("/nowhere/at/all")); }

TEST(WorkerHeartbeat, BeatsUntilItIsDestroyed) {
  const testing::TempFolder folder;
  HeartbeatWatch watch(folder / "heartbeat");
  {
    const WorkerHeartbeat heartbeat(folder / "heartbeat", folder / "lease", std::chrono::seconds(1),
                                    [] { FAIL() << "the lease is not there, so it is not over"; });
    ASSERT_TRUE(testing::Eventually([&] { return std::filesystem::exists(folder / "heartbeat"); }));
    int num_beats = 0;
    EXPECT_TRUE(testing::Eventually([&] {
      num_beats += watch.SinceChange() == milliseconds(0) ? 1 : 0;
      return num_beats == 4;
    }));
  }
  watch.SinceChange();
  absl::SleepFor(absl::Milliseconds(200));
  EXPECT_GE(watch.SinceChange(), milliseconds(200));
}

TEST(WorkerHeartbeat, ReportsALostLeaseBeforeItExpires) {
  const testing::TempFolder folder;
  ASSERT_TRUE(Touch(folder / "lease"));
  std::atomic<bool> lost = false;
  const absl::Time start = absl::Now();
  const WorkerHeartbeat heartbeat(folder / "heartbeat", folder / "lease", std::chrono::seconds(1),
                                  [&] { lost = true; });
  while (absl::Now() - start < absl::Milliseconds(500)) {
    ASSERT_TRUE(Touch(folder / "lease"));
    absl::SleepFor(absl::Milliseconds(20));
  }
  EXPECT_FALSE(lost);
  const absl::Time last = absl::Now();
  ASSERT_TRUE(testing::Eventually([&] { return lost.load(); }, absl::Seconds(10)));
  EXPECT_GE(absl::Now() - last, absl::Milliseconds(600));
}

}  // namespace
}  // namespace pepeseg
