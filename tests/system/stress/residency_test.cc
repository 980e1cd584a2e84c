// A short run of tests/system/stress/residency_stress.cc.
#include "tests/system/stress/residency.h"

#include <gtest/gtest.h>

namespace pepeseg {
namespace {

TEST(Residency, AnswersCorrectlyWithinTheBudgetWithMoreModelsThanFit) {
  ResidencyStressSettings settings;
  settings.worker = PEPESEG_MODEL_WORKER;
  settings.num_models = 6;
  settings.num_resident = 4;
  settings.num_threads = 3;
  settings.duration = absl::Seconds(2);
  const ResidencyStressReport report = RunResidencyStress(settings);
  SCOPED_TRACE(report.ToString());
  EXPECT_GT(report.num_queries, 20);
  EXPECT_EQ(report.num_wrong, 0);
  EXPECT_EQ(report.num_failed, 0) << report.first_error;
  EXPECT_EQ(report.loads_of_first_queries, 1);
  EXPECT_GT(report.num_evictions, 3);
  EXPECT_GT(report.num_samples, 5);
  EXPECT_LE(report.peak_reserved, report.limit);
  EXPECT_LE(report.peak_in_use, report.limit);
  EXPECT_EQ(report.left_reserved, 0);
  EXPECT_EQ(report.left_in_use, 0);
}

}  // namespace
}  // namespace pepeseg
