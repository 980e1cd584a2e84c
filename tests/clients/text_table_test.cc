#include "clients/terminal/text_table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace pepeseg::client::cli {
namespace {

TEST(TextTable, AlignsColumnsBelowAHeader) {
  EXPECT_THAT(
      TextTable({{"SCENE", "AGE", "STATE"}, {"a", "12 days", ""}, {"shelf", "3 s", "ok"}}),
      ::testing::ElementsAre("SCENE  AGE      STATE", "a      12 days", "shelf  3 s      ok"));
}

TEST(SpanText, KeepsTheLargestUnit) {
  EXPECT_EQ(SpanText(absl::Seconds(-5)), "0 s");
  EXPECT_EQ(SpanText(absl::Seconds(59)), "59 s");
  EXPECT_EQ(SpanText(absl::Seconds(3599)), "59 min");
  EXPECT_EQ(SpanText(absl::Hours(47)), "47 h");
  EXPECT_EQ(SpanText(absl::Hours(24 * 12)), "12 days");
}

TEST(SizeText, ChoosesTheUnitBySize) {
  EXPECT_EQ(SizeText(0), "0 kB");
  EXPECT_EQ(SizeText(840'000), "840 kB");
  EXPECT_EQ(SizeText(12'300'000), "12.3 MB");
  EXPECT_EQ(SizeText(1'200'000'000), "1.2 GB");
}

TEST(WaitText, SaysWhatAJobWaitsFor) {
  const absl::Time now = absl::FromUnixSeconds(1000);
  v1::Job::Wait wait;
  EXPECT_EQ(WaitText(wait, now), "");
  wait.set_reason(v1::Job::Wait::REASON_DEVICE);
  EXPECT_EQ(WaitText(wait, now), "next, when a device is free");
  wait.set_jobs_ahead(1);
  EXPECT_EQ(WaitText(wait, now), "after 1 other, when a device is free");
  wait.set_jobs_ahead(2);
  EXPECT_EQ(WaitText(wait, now), "after 2 others, when a device is free");
  wait.set_reason(v1::Job::Wait::REASON_QUOTA);
  EXPECT_EQ(WaitText(wait, now), "until another job of its project ends, by its quota");
  wait.set_reason(v1::Job::Wait::REASON_RETRY);
  wait.mutable_retry_time()->set_seconds(1012);
  EXPECT_EQ(WaitText(wait, now), "12 s until the next attempt");
}

TEST(WordOf, LeavesOutThePrefixOfTheType) {
  EXPECT_EQ(WordOf(v1::JOB_STATE_SUCCEEDED), "succeeded");
  EXPECT_EQ(WordOf(v1::JOB_STAGE_RECONSTRUCT), "reconstruct");
  EXPECT_EQ(WordOf(v1::JobEvent::TermSkipped::TERM_BANDS), "bands");
  EXPECT_EQ(WordOf(v1::SCOPE_READ), "read");
  EXPECT_EQ(WordOf(v1::ServerStatus::WORK_EVALUATION), "evaluation");
}

TEST(WordOf, IsEmptyForNoValue) {
  EXPECT_EQ(WordOf(v1::JOB_STAGE_UNSPECIFIED), "");
  EXPECT_EQ(WordOf(v1::JobEvent::TermSkipped::TERM_UNSPECIFIED), "");
}

TEST(WordOf, NumbersTheValuesOfANewerServer) {
  EXPECT_EQ(WordOf(static_cast<v1::JobStage>(99)), "99");
}

}  // namespace
}  // namespace pepeseg::client::cli
