// The run of kill_server.h: short, or long with PEPESEG_STRESS=full.
#include "tests/system/stress/kill_server.h"

#include <gtest/gtest.h>

#include <iostream>

#include "tests/testing/full_stress.h"

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

}  // namespace
}  // namespace pepeseg
