#include "server/worker/worker_progress.h"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <thread>

#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

class WorkerProgressTest : public ::testing::Test {
 protected:
  WorkerProgressTest()
      : path_(folder_.path() / "events.log"), log_(EventLogWriter::Open(path_).value()) {}

  // Reports ten steps with a PSNR of 1, 2, ... 10 dB.
  std::vector<v1::JobProgress> TakeTenSteps(WorkerProgress::Clock::duration interval) {
    WorkerProgress progress(*log_, interval);
    EXPECT_OK(progress.StartStage(Stage::kReconstruct));
    for (int step = 1; step <= 10; ++step) {
      StepReport report;
      report.step = step;
      report.num_steps = 10;
      report.loss = step == 10 ? std::nan("") : 0.5;
      report.psnr = step;
      EXPECT_OK(progress.Step(report));
    }
    std::vector<v1::JobProgress> reported;
    EventLogReader reader(path_);
    const auto events = reader.Read();
    for (const v1::JobEvent& event : *events) {
      if (event.has_progress()) reported.push_back(event.progress());
    }
    return reported;
  }

  testing::TempFolder folder_;
  std::filesystem::path path_;
  std::unique_ptr<EventLogWriter> log_;
};

TEST_F(WorkerProgressTest, ReportsEveryStepThatIsDue) {
  EXPECT_EQ(TakeTenSteps(std::chrono::nanoseconds(0)).size(), 10u);
}

TEST_F(WorkerProgressTest, ReportsTheCounters) {
  WorkerProgress progress(*log_, std::chrono::nanoseconds(0));
  ASSERT_OK(progress.StartStage(Stage::kReconstruct));
  StepReport report;
  report.step = 1;
  report.num_steps = 10;
  report.num_culled_degenerate = 3;
  report.num_skipped_gradients = 4;
  report.depth_loss = 0.25;
  report.num_skipped_depths = 6;
  report.num_overflowed_renders = 5;
  ASSERT_OK(progress.Step(report));
  const auto events = EventLogReader(path_).Read();
  ASSERT_TRUE(events.ok() && !events->empty());
  const v1::JobProgress::Diagnostics& reported = events->back().progress().diagnostics();
  EXPECT_EQ(reported.num_culled_degenerate(), 3);
  EXPECT_EQ(reported.num_skipped_gradients(), 4);
  EXPECT_EQ(reported.depth_loss(), 0.25);
  EXPECT_EQ(reported.num_skipped_depths(), 6);
  EXPECT_EQ(reported.num_overflowed_renders(), 5);
}

TEST_F(WorkerProgressTest, ReportsActivityAndUnit) {
  WorkerProgress progress(*log_, std::chrono::hours(1));
  ASSERT_OK(progress.StartStage(Stage::kSfm));
  StepReport report{.step = 20,
                    .num_steps = 20,
                    .activity = "finding features in",
                    .unit = "photographs",
                    .share = 0.2};
  ASSERT_OK(progress.Step(report));
  report.activity = "matching";
  report.unit = "pairs";
  report.step = 19;
  report.num_steps = 60;
  report.share = 0.5;
  std::this_thread::sleep_for(std::chrono::milliseconds(20));
  ASSERT_OK(progress.Step(report)) << "the first of an activity is reported at once";
  const auto events = EventLogReader(path_).Read();
  ASSERT_EQ(events->size(), 3u);
  const v1::JobProgress& reported = events->back().progress();
  EXPECT_EQ(reported.activity(), "matching");
  EXPECT_EQ(reported.unit(), "pairs");
  EXPECT_EQ(reported.step(), 19);
  EXPECT_EQ(reported.num_steps(), 60);
  EXPECT_GE(reported.steps_per_second(), 0);
  const auto seconds = [](const google::protobuf::Duration& time) {
    return static_cast<double>(time.seconds()) + 1e-9 * time.nanos();
  };
  EXPECT_NEAR(seconds(reported.eta()), seconds(reported.elapsed()), 0.01)
      << "half of the work is done";
  EXPECT_FALSE(reported.has_job_eta());
  EXPECT_EQ(reported.stage_number(), 0) << "nothing was planned";
}

TEST_F(WorkerProgressTest, ReportsTheStagesNumberAndTheJobsEta) {
  WorkerProgress progress(*log_, std::chrono::nanoseconds(0));
  progress.Plan({{.stage = Stage::kPrepare, .seconds = 1},
                 {.stage = Stage::kReconstruct, .seconds = 1},
                 {.stage = Stage::kIndex, .seconds = 1}});
  ASSERT_OK(progress.StartStage(Stage::kReconstruct));
  StepReport report{.step = 1, .num_steps = 2};
  ASSERT_OK(progress.Step(report));
  std::this_thread::sleep_for(std::chrono::milliseconds(1100));
  ASSERT_OK(progress.Step(report));
  const auto events = EventLogReader(path_).Read();
  ASSERT_EQ(events->size(), 3u);
  EXPECT_FALSE(events->at(1).progress().has_job_eta()) << "no pace yet";
  const v1::JobProgress& reported = events->back().progress();
  EXPECT_EQ(reported.stage_number(), 2);
  EXPECT_EQ(reported.num_stages(), 3);
  ASSERT_TRUE(reported.has_job_eta());
  EXPECT_GE(reported.job_eta().seconds(),
            3);  // 1.1 s of the stage, and 2.2 times the 1 s of "index"
  EXPECT_LE(reported.job_eta().seconds(), 10);
}

TEST_F(WorkerProgressTest, ReportsASkippedPartAndItsStage) {
  WorkerProgress progress(*log_);
  ASSERT_OK(progress.StartStage(Stage::kFeatures));
  ASSERT_OK(progress.SkipPart({Part::kPerception, "no training view has a depth prior"}));
  EventLogReader reader(path_);
  const auto events = reader.Read();
  ASSERT_EQ(events->size(), 2u);
  const v1::JobEvent::TermSkipped& skipped = events->back().term_skipped();
  EXPECT_EQ(skipped.stage(), v1::JOB_STAGE_FEATURES);
  EXPECT_EQ(skipped.term(), v1::JobEvent::TermSkipped::TERM_PERCEPTION);
  EXPECT_EQ(skipped.reason(), "no training view has a depth prior");
}

TEST_F(WorkerProgressTest, ReportsTheTimeThatSkippedStepsSave) {
  WorkerProgress progress(*log_);
  ASSERT_OK(progress.StartStage(Stage::kReconstruct));
  progress.ResumeAt(1000);
  std::this_thread::sleep_for(std::chrono::milliseconds(20));
  const double before = progress.seconds_in_stage();
  ASSERT_OK(progress.SkipPart({Part::kSteps, "the loss has stopped falling", 1100, 300}));
  const double after = progress.seconds_in_stage();
  const auto events = EventLogReader(path_).Read();
  ASSERT_TRUE(events.ok() && !events->empty());
  const v1::JobEvent::TermSkipped& skipped = events->back().term_skipped();
  EXPECT_EQ(skipped.step(), 1100);
  EXPECT_EQ(skipped.saved_steps(), 300);
  const double saved =
      1e-9 * skipped.saved().nanos() + static_cast<double>(skipped.saved().seconds());
  EXPECT_GE(saved, 3 * before - 1e-5);
  EXPECT_LE(saved, 3 * after + 1e-5);
}

TEST_F(WorkerProgressTest, MeasuresThePaceSinceAResume) {
  WorkerProgress progress(*log_, std::chrono::hours(1));
  ASSERT_OK(progress.StartStage(Stage::kReconstruct));
  progress.ResumeAt(1000);
  StepReport report;
  report.step = 1001;
  report.num_steps = 1003;
  ASSERT_OK(progress.Step(report));
  const auto events = EventLogReader(path_).Read();
  ASSERT_TRUE(events.ok() && events->size() == 2);  // the stage's start, and its first step
  const v1::JobProgress& reported = events->back().progress();
  const auto seconds = [](const google::protobuf::Duration& duration) {
    return static_cast<double>(duration.seconds()) + duration.nanos() * 1e-9;
  };
  EXPECT_NEAR(seconds(reported.eta()), 2 * seconds(reported.elapsed()), 1e-5);
}

TEST_F(WorkerProgressTest, AlwaysReportsTheFirstAndTheLastStep) {
  const auto reported = TakeTenSteps(std::chrono::hours(1));
  ASSERT_EQ(reported.size(), 2u);
  EXPECT_EQ(reported[0].step(), 1);
  EXPECT_EQ(reported[1].step(), 10);
  EXPECT_EQ(reported[1].stage(), v1::JOB_STAGE_RECONSTRUCT);
  EXPECT_EQ(reported[1].eta().seconds(), 0);
  EXPECT_GT(reported[1].memory_bytes(), 0);
}

TEST_F(WorkerProgressTest, AveragesPsnrSinceTheLastReport) {
  const auto reported = TakeTenSteps(std::chrono::hours(1));
  ASSERT_EQ(reported.size(), 2u);
  EXPECT_DOUBLE_EQ(reported[0].psnr(), 1);
  EXPECT_DOUBLE_EQ(reported[1].psnr(), 6);  // the mean of 2, 3, ... 10
}

TEST_F(WorkerProgressTest, OmitsWhatWasNotMeasured) {
  const auto reported = TakeTenSteps(std::chrono::hours(1));
  ASSERT_EQ(reported.size(), 2u);
  EXPECT_DOUBLE_EQ(reported[0].loss(), 0.5);
  EXPECT_FALSE(reported[1].has_loss());
}

}  // namespace
}  // namespace pepeseg
