#include "clients/terminal/progress_line.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace pepeseg::client::cli {
namespace {

using ::testing::AnyOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

v1::JobProgress Reconstructing() {
  v1::JobProgress progress;
  progress.set_stage(v1::JOB_STAGE_RECONSTRUCT);
  progress.set_step(1200);
  progress.set_num_steps(2400);
  progress.set_loss(0.0612);
  progress.set_psnr(21.31);
  progress.set_num_gaussians(1084120);
  progress.mutable_eta()->set_seconds(65);
  progress.mutable_job_eta()->set_seconds(301);
  progress.set_stage_number(3);
  progress.set_num_stages(5);
  return progress;
}

TEST(ProgressText, BeginsWithTheTimeLeftOfTheJob) {
  EXPECT_EQ(ProgressText(Reconstructing(), 200),
            "about 5 min left, stage 3 of 5  reconstruct 1200/2400  [######......]  loss 0.0612  "
            "21.31 dB  1,084,120 Gaussians");
}

TEST(ProgressText, NeverCutsOffTheTimeLeft) {
  for (size_t columns = 1; columns < 120; ++columns) {
    const std::string text = ProgressText(Reconstructing(), columns);
    EXPECT_LE(text.size(), std::max<size_t>(columns, 14));
    EXPECT_THAT(text, HasSubstr("5 min left"));
    EXPECT_THAT(text, AnyOf(HasSubstr("stage 3 of 5"), HasSubstr("3/5")));
  }
  EXPECT_EQ(ProgressText(Reconstructing(), 20), "5 min left 3/5");
  EXPECT_EQ(ProgressText(Reconstructing(), 60),
            "about 5 min left, stage 3 of 5  reconstruct 1200/2400");
}

TEST(ProgressText, NamesTheUnitOfTheSteps) {
  v1::JobProgress progress;
  progress.set_stage(v1::JOB_STAGE_SFM);
  progress.set_activity("matching");
  progress.set_unit("pairs");
  progress.set_step(19);
  progress.set_num_steps(60);
  EXPECT_THAT(ProgressText(progress, 200), HasSubstr("sfm: matching 19 of 60 pairs"));
}

TEST(ProgressText, FallsBackToTheTimeLeftOfTheStage) {
  v1::JobProgress progress = Reconstructing();
  progress.clear_job_eta();
  EXPECT_THAT(ProgressText(progress, 200), StartsWith("about 1 min left of stage 3 of 5  "));
  progress.clear_num_stages();
  EXPECT_THAT(ProgressText(progress, 200), StartsWith("about 1 min left of this stage  "));
  progress.clear_eta();
  EXPECT_THAT(ProgressText(progress, 200), StartsWith("reconstruct 1200/2400"));
}

TEST(ProgressText, LeavesOutWhatWasNotMeasured) {
  v1::JobProgress progress;
  progress.set_stage(v1::JOB_STAGE_PREPARE);
  const std::string text = ProgressText(progress, 200);
  EXPECT_THAT(text, HasSubstr("0/0"));
  EXPECT_THAT(text, Not(HasSubstr("loss")));
  EXPECT_THAT(text, Not(HasSubstr("left")));
}

TEST(AboutText, RoundsLongTimes) {
  EXPECT_EQ(AboutText(-3), "0 s");
  EXPECT_EQ(AboutText(7), "7 s");
  EXPECT_EQ(AboutText(42), "40 s");
  EXPECT_EQ(AboutText(59), "1 min");
  EXPECT_EQ(AboutText(301), "5 min");
  EXPECT_EQ(AboutText(3600), "1 h");
  EXPECT_EQ(AboutText(4800), "1 h 20 min");
}

TEST(ClockText, ReadsLikeAClock) {
  EXPECT_EQ(ClockText(0), "0:00");
  EXPECT_EQ(ClockText(65.4), "1:05");
  EXPECT_EQ(ClockText(7265), "2:01:05");
}

}  // namespace
}  // namespace pepeseg::client::cli
