#include "clients/cli/progress_line.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace pepeseg::client::cli {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

TEST(ProgressText, TellsWhereAStageIs) {
  v1::JobProgress progress;
  progress.set_stage("reconstruct");
  progress.set_step(1200);
  progress.set_num_steps(2400);
  progress.set_loss(0.0612);
  progress.set_psnr(21.31);
  progress.set_num_gaussians(1084120);
  progress.mutable_eta()->set_seconds(65);
  const std::string text = ProgressText(progress, 200);
  EXPECT_EQ(text,
            "reconstruct [############............]  1200/2400  loss 0.0612  21.31 dB  "
            "1,084,120 Gaussians  ETA 1:05");
  EXPECT_EQ(ProgressText(progress, 20).size(), 20U);
}

TEST(ProgressText, LeavesOutWhatWasNotMeasured) {
  v1::JobProgress progress;
  progress.set_stage("prepare");
  const std::string text = ProgressText(progress, 200);
  EXPECT_THAT(text, HasSubstr("0/0"));
  EXPECT_THAT(text, Not(HasSubstr("loss")));
  EXPECT_THAT(text, Not(HasSubstr("ETA")));
}

TEST(ClockText, ReadsLikeAClock) {
  EXPECT_EQ(ClockText(0), "0:00");
  EXPECT_EQ(ClockText(65.4), "1:05");
  EXPECT_EQ(ClockText(7265), "2:01:05");
}

}  // namespace
}  // namespace pepeseg::client::cli
