// The short forms, and with PEPESEG_STRESS=full the whole of what io_fault_lives.h says.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <iostream>
#include <set>

#include "tests/stress/full_stress.h"
#include "tests/stress/io_fault_lives.h"

namespace pepeseg {
namespace {

using testing::FullStress;

std::set<std::string> CodesOf(const FaultReport& report) {
  std::set<std::string> codes;
  for (const auto& [code, count] : report.codes) codes.insert(code);
  return codes;
}

TEST(KillServer, AtAnyDurableCallLeavesACleanState) {
  const FaultReport report = KillAtEveryDurableCall(FullStress() ? 1 : 17);
  std::cout << report.ToString() << "\n";
  EXPECT_TRUE(report.broken.empty());
  EXPECT_TRUE(report.unclean.empty());
  EXPECT_GE(report.num_points, 30);
  // The calls of threads that race change their places a little.
  EXPECT_GE(report.num_killed, report.num_tried * 9 / 10);
}

TEST(FullDisk, FailsInWordsAndGoesOnWhenThereIsSpace) {
  const FaultReport report = FillDiskAtEveryCall(FullStress() ? 1 : 67);
  std::cout << report.ToString() << "\n";
  EXPECT_TRUE(report.broken.empty());
  EXPECT_TRUE(report.unclean.empty());
  EXPECT_THAT(CodesOf(report),
              ::testing::IsSubsetOf({"OK", "RESOURCE_EXHAUSTED", "did not start"}));
  EXPECT_THAT(CodesOf(report), ::testing::Contains("RESOURCE_EXHAUSTED"));
}

// Of what a server reads, each call in turn.
TEST(ReadError, IsToldAndHarmsNothing) {
  const FaultReport report = FailEveryRead(FullStress() ? 1 : 37);
  std::cout << report.ToString() << "\n";
  EXPECT_TRUE(report.broken.empty());
  EXPECT_TRUE(report.unclean.empty());
  EXPECT_GE(report.num_points, 30);
  EXPECT_THAT(CodesOf(report),
              ::testing::IsSubsetOf({"OK", "INTERNAL", "DATA_LOSS", "did not start"}));
}

}  // namespace
}  // namespace pepeseg
