// pepeseg_residency_stress [SECONDS]: queries twenty models within a memory budget for nine.
#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>

#include "tests/system/stress/residency.h"

namespace {

int seconds = 600;

TEST(ResidencyStress, StaysWithinTheBudgetAndAnswersCorrectly) {
  pepeseg::ResidencyStressSettings settings;
  settings.worker = PEPESEG_MODEL_WORKER;
  settings.duration = absl::Seconds(seconds);
  const pepeseg::ResidencyStressReport report = pepeseg::RunResidencyStress(settings);
  std::fputs(report.ToString().c_str(), stdout);
  EXPECT_GT(report.num_queries, seconds);
  EXPECT_EQ(report.num_wrong, 0);
  EXPECT_EQ(report.num_failed, 0) << report.first_error;
  EXPECT_EQ(report.loads_of_first_queries, 1);
  EXPECT_GT(report.num_evictions, seconds / 10);
  EXPECT_LE(report.peak_reserved, report.limit);
  EXPECT_LE(report.peak_in_use, report.limit);
  EXPECT_EQ(report.left_reserved, 0);
  EXPECT_EQ(report.left_in_use, 0);
  // Memory that threads and gRPC keep. ASan's quarantine is as large.
  constexpr int64_t kSlack = int64_t{300} << 20;
  EXPECT_LT(report.rss_after, report.rss_before + kSlack);
}

}  // namespace

int main(int argc, char** argv) {
  ::testing::InitGoogleTest(&argc, argv);
  if (argc > 1) seconds = std::atoi(argv[1]);
  return RUN_ALL_TESTS();
}
