#include "clients/cli/enum_words.h"

#include <gtest/gtest.h>

namespace pepeseg::client::cli {
namespace {

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
