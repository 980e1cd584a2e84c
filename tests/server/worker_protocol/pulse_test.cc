#include "server/worker_protocol/pulse.h"

#include <gtest/gtest.h>

#include <atomic>

#include "absl/time/clock.h"
#include "server/jobs/holder_name.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

using std::chrono::milliseconds;

TEST(PulseWatch, SilenceIsFromTheLastChange) {
  const testing::TempFolder folder;
  PulseWatch watch(folder / "pulse");
  EXPECT_EQ(watch.Silence(), milliseconds(0));
  absl::SleepFor(absl::Milliseconds(30));
  EXPECT_EQ(watch.Silence(), milliseconds(0));  // not there: nothing is said
  ASSERT_TRUE(Touch(folder / "pulse"));
  watch.Silence();
  absl::SleepFor(absl::Milliseconds(50));
  EXPECT_GE(watch.Silence(), milliseconds(50));
  ASSERT_TRUE(Touch(folder / "pulse"));
  EXPECT_LT(watch.Silence(), milliseconds(50));
}

TEST(PulseWatch, FolderThatIsGoneCannotBeTouched) { EXPECT_FALSE(Touch("/nowhere/at/all")); }

TEST(WorkerPulse, BeatsUntilItIsDestroyed) {
  const testing::TempFolder folder;
  PulseWatch watch(folder / "pulse");
  {
    const WorkerPulse pulse(folder / "pulse", folder / "lease", std::chrono::seconds(1),
                            [] { FAIL() << "the lease is not there, so it is not over"; });
    absl::SleepFor(absl::Milliseconds(300));
    EXPECT_TRUE(std::filesystem::exists(folder / "pulse"));
    EXPECT_LT(watch.Silence(), milliseconds(200));
  }
  watch.Silence();
  absl::SleepFor(absl::Milliseconds(200));
  EXPECT_GE(watch.Silence(), milliseconds(200));
}

TEST(WorkerPulse, TellsALeaseThatIsNotProlongedBeforeItIsOver) {
  const testing::TempFolder folder;
  ASSERT_TRUE(Touch(folder / "lease"));
  std::atomic<bool> lost = false;
  const absl::Time start = absl::Now();
  const WorkerPulse pulse(folder / "pulse", folder / "lease", std::chrono::seconds(1),
                          [&] { lost = true; });
  while (absl::Now() - start < absl::Milliseconds(500)) {
    ASSERT_TRUE(Touch(folder / "lease"));
    absl::SleepFor(absl::Milliseconds(20));
  }
  EXPECT_FALSE(lost);
  const absl::Time last = absl::Now();
  while (!lost && absl::Now() - last < absl::Seconds(10)) absl::SleepFor(absl::Milliseconds(5));
  ASSERT_TRUE(lost);
  EXPECT_GE(absl::Now() - last, absl::Milliseconds(600));
}

TEST(HolderName, IsOfAProcessThatLives) {
  const std::string name = HolderName();
  EXPECT_EQ(name, HolderName());
  EXPECT_FALSE(IsKnownGone(name));
  EXPECT_TRUE(IsKnownGone(name + "1"));  // the number was another process's before
  EXPECT_FALSE(IsKnownGone("another-boot/pid:[1]/1/2"));
  EXPECT_FALSE(IsKnownGone(""));
  EXPECT_FALSE(IsKnownGone("server"));
}

}  // namespace
}  // namespace pepeseg
