// The short forms, and with PEPESEG_STRESS=full the whole of what kill_server.h says.
#include "tests/stress/kill_server.h"

#include <gtest/gtest.h>

#include <iostream>

#include "tests/stress/full_stress.h"

namespace pepeseg {
namespace {

using testing::FullStress;

TEST(KillServer, LosesNothingThatWasAcknowledged) {
  const KillServerReport report = KillServerAgainAndAgain(FullStress() ? 100 : 8, 4);
  std::cout << report.ToString() << "\n";
  EXPECT_TRUE(report.broken.empty());
  EXPECT_TRUE(report.unclean.empty());
  EXPECT_GT(report.num_lives, 0);
  EXPECT_LT(report.slowest_start, absl::Seconds(3));
}

TEST(KillServer, AtAnyDurableCallLeavesACleanState) {
  const FaultReport report = KillAtEveryDurableCall(FullStress() ? 1 : 17);
  std::cout << report.ToString() << "\n";
  EXPECT_TRUE(report.broken.empty());
  EXPECT_TRUE(report.unclean.empty());
  EXPECT_GE(report.num_points, 30);
  // The calls of threads that race change their places a little.
  EXPECT_GE(report.num_fired, report.num_tried * 9 / 10);
}

TEST(FullDisk, FailsInWordsAndGoesOnWhenThereIsSpace) {
  const FaultReport report = FillDiskAtEveryCall(FullStress() ? 1 : 29);
  std::cout << report.ToString() << "\n";
  EXPECT_TRUE(report.broken.empty());
  EXPECT_TRUE(report.unclean.empty());
}

}  // namespace
}  // namespace pepeseg
