#include "server/worker/job_eta.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <utility>

namespace pepeseg {
namespace {

using ::testing::DoubleNear;
using ::testing::Optional;

// A stage as it really runs.
struct ActualStage {
  Stage stage;
  int64_t num_steps = 0;  // 0: it reports none
  double seconds = 0;
};

struct Moment {
  double now = 0;   // seconds since the start of the job
  double left = 0;  // estimated remaining seconds
  int stage = 0;
};

// Runs the stages on a simulated clock, with one report a second, and returns the estimates.
std::vector<Moment> RunStages(JobEta& eta, const std::vector<ActualStage>& stages) {
  std::vector<Moment> moments;
  double start = 0;
  for (const ActualStage& stage : stages) {
    eta.StartStage(stage.stage, start);
    for (double t = 1; stage.num_steps > 0 && t <= stage.seconds; t += 1) {
      const auto step = static_cast<int64_t>(std::lround(t / stage.seconds * stage.num_steps));
      eta.Step(0, step, stage.num_steps, start + t);
      if (const auto left = eta.SecondsLeft(start + t)) {
        moments.push_back({start + t, *left, eta.stage_number()});
      }
    }
    start += stage.seconds;
    eta.EndStage(start);
  }
  return moments;
}

// Checks that from one report to the next the predicted end moves by at most this share of the
// remaining time plus 2 s.
void ExpectSteady(const std::vector<Moment>& moments, double share) {
  for (size_t i = 1; i < moments.size(); ++i) {
    const double passed = moments[i].now - moments[i - 1].now;
    const double moved = std::abs(moments[i].left + passed - moments[i - 1].left);
    EXPECT_LE(moved, 2 + share * moments[i - 1].left * passed) << "after " << moments[i].now;
  }
}

const std::vector<PlannedStage> kPlan = {{.stage = Stage::kPrepare, .seconds = 2},
                                         {.stage = Stage::kReconstruct, .seconds = 100},
                                         {.stage = Stage::kEvaluate, .seconds = 4},
                                         {.stage = Stage::kFeatures, .seconds = 60},
                                         {.stage = Stage::kIndex, .seconds = 1}};

TEST(JobEta, IsExactIfTheJobRunsAsPlanned) {
  JobEta eta;
  eta.Plan(kPlan);
  const auto moments = RunStages(eta, {{Stage::kPrepare, 0, 2},
                                       {Stage::kReconstruct, 1000, 100},
                                       {Stage::kEvaluate, 0, 4},
                                       {Stage::kFeatures, 6000, 60},
                                       {Stage::kIndex, 0, 1}});
  ASSERT_GT(moments.size(), 150u);
  for (const Moment& moment : moments) {
    EXPECT_NEAR(moment.left, 167 - moment.now, 0.5) << "after " << moment.now;
  }
  EXPECT_EQ(moments.front().stage, 2);
  EXPECT_EQ(moments.back().stage, 4);
  EXPECT_EQ(eta.num_stages(), 5);
}

TEST(JobEta, ScalesLaterStagesByTheMeasuredPace) {
  JobEta eta;
  eta.Plan(kPlan);  // everything takes 6 times as long
  // Many steps: a rounded number of them does not show in the pace.
  const auto moments = RunStages(eta, {{Stage::kPrepare, 0, 12},
                                       {Stage::kReconstruct, 100000, 600},
                                       {Stage::kEvaluate, 0, 24},
                                       {Stage::kFeatures, 60000, 360},
                                       {Stage::kIndex, 0, 6}});
  for (const Moment& moment : moments) {
    EXPECT_NEAR(moment.left, 1002 - moment.now, 3) << "after " << moment.now;
  }
}

TEST(JobEta, DoesNotJumpWhenStagesDeviateFromThePlan) {
  JobEta eta;
  eta.Plan(kPlan);  // features take four times their share
  const auto moments = RunStages(eta, {{Stage::kPrepare, 0, 2},
                                       {Stage::kReconstruct, 1000, 100},
                                       {Stage::kEvaluate, 0, 4},
                                       {Stage::kFeatures, 6000, 240},
                                       {Stage::kIndex, 0, 1}});
  ExpectSteady(moments, 0.5);
  for (const Moment& moment : moments) {
    const double truth = 347 - moment.now;
    // The estimate cannot be right before the second stage has a pace.
    if (moment.now > 180) {
      EXPECT_NEAR(moment.left, truth, 3 + 0.15 * truth) << "after " << moment.now;
    }
  }
}

TEST(JobEta, DoesNotFollowSingleSlowSteps) {
  JobEta eta;
  eta.Plan(kPlan);
  eta.StartStage(Stage::kReconstruct, 0);
  std::vector<Moment> moments;
  double now = 0;
  for (int step = 1; step <= 1000; ++step) {
    now += step % 100 == 0 ? 3 : 0.07;  // every hundredth step saves a checkpoint
    eta.Step(0, step, 1000, now);
    if (const auto left = eta.SecondsLeft(now)) moments.push_back({now, *left, 1});
  }
  ExpectSteady(moments, 0.1);
}

TEST(JobEta, ReachesAShorterEndWhenStepsAreLeftOut) {
  JobEta eta;
  eta.Plan({{.stage = Stage::kReconstruct,
             .seconds = 100,
             .pieces = {{.num_steps = 10000, .seconds_per_step = 0.01}}}});
  eta.StartStage(Stage::kReconstruct, 0);
  std::vector<Moment> moments;
  for (int second = 1; second <= 45; ++second) {
    // At step 4000 the stage decides to skip 5500 steps.
    const int64_t num_steps = second < 40 ? 10000 : 4500;
    eta.Step(0, int64_t{100} * second, num_steps, second);
    moments.push_back({double(second), eta.SecondsLeft(second).value_or(-1), 1});
  }
  EXPECT_NEAR(moments[38].left, 61, 2);
  EXPECT_NEAR(moments.back().left, 0, 5);
  EXPECT_NEAR(*eta.StageSecondsLeft(), 0, 1e-6);
}

TEST(JobEta, WeighsStepsByTheirCost) {
  JobEta eta;
  // Half of the steps run on shrunk photographs, at a tenth of the cost.
  eta.Plan({{.stage = Stage::kReconstruct, .seconds = 110, .pieces = {{1000, 0.01}, {1000, 0.1}}}});
  eta.StartStage(Stage::kReconstruct, 0);
  eta.Step(0, 500, 2000, 5);
  EXPECT_THAT(eta.StageSecondsLeft(), Optional(DoubleNear(105, 1e-6)));
  eta.Step(0, 1000, 2000, 10);
  EXPECT_THAT(eta.StageSecondsLeft(), Optional(DoubleNear(100, 1e-6)));
  eta.Step(0, 1500, 2000, 60);
  EXPECT_THAT(eta.StageSecondsLeft(), Optional(DoubleNear(50, 1e-6)));
}

TEST(JobEta, UsesThePaceOfThisAttemptOnly) {
  JobEta eta;
  eta.Plan(kPlan);
  eta.StartStage(Stage::kReconstruct, 0);
  eta.Step(900, 910, 1000, 10);  // an earlier attempt did 900 steps
  EXPECT_THAT(eta.StageSecondsLeft(), Optional(DoubleNear(90, 1e-6)));
}

TEST(JobEta, IsUnknownWithoutAPaceOrBeforeAStageOfUnknownLength) {
  JobEta eta;
  eta.Plan({{.stage = Stage::kSfm, .seconds = 10},
            {.stage = Stage::kPriors},
            {.stage = Stage::kIndex, .seconds = 5}});
  EXPECT_EQ(eta.SecondsLeft(0), std::nullopt);
  eta.StartStage(Stage::kSfm, 0);
  EXPECT_EQ(eta.SecondsLeft(1), std::nullopt);
  eta.Share(0.5, 5);
  EXPECT_EQ(eta.SecondsLeft(5), std::nullopt) << "nobody knows how long priors take";
  EXPECT_THAT(eta.StageSecondsLeft(), Optional(DoubleNear(5, 1e-6)));
  eta.StartStage(Stage::kPriors, 10);
  EXPECT_EQ(eta.SecondsLeft(11), std::nullopt);
  eta.Step(0, 1, 4, 20);
  EXPECT_THAT(eta.SecondsLeft(20), Optional(DoubleNear(30 + 5, 1e-6)));
  EXPECT_EQ(eta.stage_number(), 2);
}

TEST(JobEta, IgnoresThePaceOfStagesOfLessThanASecond) {
  JobEta eta;
  eta.Plan(
      {{.stage = Stage::kPrepare, .seconds = 0.01}, {.stage = Stage::kReconstruct, .seconds = 60}});
  eta.StartStage(Stage::kPrepare, 0);
  eta.Share(1, 0.4);  // forty times slower than expected, as when a process starts
  eta.StartStage(Stage::kReconstruct, 0.4);
  eta.Step(0, 1, 2000, 0.5);
  EXPECT_EQ(eta.SecondsLeft(0.5), std::nullopt);
  eta.Step(0, 41, 2000, 2.5);
  // From the first report on, 40 steps took 2 s.
  EXPECT_THAT(eta.SecondsLeft(2.5), Optional(DoubleNear(1959 * 0.05, 1e-6)));
}

TEST(JobEta, DoesNotTakeTheTimeBeforeTheFirstStepForThatOfAStep) {
  JobEta eta;
  eta.Plan({{.stage = Stage::kReconstruct, .seconds = 60}});
  eta.StartStage(Stage::kReconstruct, 0);
  eta.Step(0, 1, 2000,
           15);  // a first report after 15 s of preparation, once taken for 8 hours left
  EXPECT_EQ(eta.StageSecondsLeft(), std::nullopt);
  EXPECT_EQ(eta.SecondsLeft(15), std::nullopt);
  eta.Step(0, 101, 2000, 20);
  EXPECT_THAT(eta.StageSecondsLeft(), Optional(DoubleNear(1899 * 0.05, 1e-6)));
}

// The cost of the steps of `make demo`, core seconds, as measured on 2026-11-27, and the seconds
// before the first step of a stage. Those of stage two were measured on 2026-11-29 on a faster
// machine, in steps: 390 before the first, and 200 for the rows of the second chunk.
struct DemoCosts {
  double speed = 1;  // of the machine
  double threads = 2;
  double fine = 1, features = 1;  // further factors of fine steps and of stage two
};

// Returns the pause before a step, in seconds.
double DemoStep(const DemoCosts& costs, Stage stage, int step) {
  double cores = 0;
  if (stage == Stage::kReconstruct) {
    cores = step <= 500 ? 0.005 : step <= 1000 ? 0.022 : 0.080 * costs.fine;
  } else {
    cores = (step == 1 ? 9.6 : step == 751 ? 4.9 : 0.0246) * costs.features;
  }
  return cores / costs.threads / costs.speed;
}

// Runs the demo on a simulated clock, and returns the estimates and the time that it took.
std::pair<std::vector<Moment>, double> RunDemo(const DemoCosts& costs) {
  TrainingFacts facts;
  facts.has_poses = facts.has_masks = facts.has_depth = true;
  facts.num_threads = static_cast<int>(costs.threads);
  facts.num_photographs = 15;
  facts.megapixels = 0.3072;
  TrainingSettings settings;
  settings.reconstruct.num_steps = 2000;
  settings.reconstruct.coarse_until = 0.5;
  settings.features.num_steps = 1500;
  JobEta eta;
  eta.Plan(PlanStages(facts, settings));
  std::vector<Moment> moments;
  double now = 1.5, reported = 0;  // after stage "prepare"
  for (const auto& [stage, num_steps] :
       {std::pair(Stage::kReconstruct, 2000), {Stage::kFeatures, 1500}}) {
    eta.StartStage(stage, now);
    for (int step = 1; step <= num_steps; ++step) {
      now += DemoStep(costs, stage, step);
      if (step > 1 && now - reported < 0.25) continue;
      reported = now;
      eta.Step(0, step, num_steps, now);
      if (const auto left = eta.SecondsLeft(now)) moments.push_back({now, *left, 0});
    }
    eta.EndStage(now);
  }
  return {moments, now};
}

TEST(JobEta, IsRightWithinAThirdFromTenSecondsOnInTheDemo) {
  for (const DemoCosts& costs : {DemoCosts{}, DemoCosts{.speed = 2}, DemoCosts{.speed = 0.4},
                                 DemoCosts{.fine = 1.2}, DemoCosts{.features = 0.8}}) {
    const auto [moments, end] = RunDemo(costs);
    ASSERT_LT(moments.front().now, 10);
    for (const Moment& moment : moments) {
      const double truth = end - moment.now;
      if (moment.now < 10 || truth < 3) continue;  // a line shows whole seconds
      EXPECT_NEAR(moment.left, truth, truth / 3 + 1)
          << "after " << moment.now << " of " << end << " s at speed " << costs.speed;
    }
  }
}

TEST(JobEta, KeepsHostAndDeviceApart) {
  JobEta eta;
  eta.Plan({{.stage = Stage::kSfm, .seconds = 10},
            {.stage = Stage::kReconstruct, .seconds = 100, .on_device = true},
            {.stage = Stage::kIndex, .seconds = 1}});
  eta.StartStage(Stage::kSfm, 0);
  eta.Share(0.5, 50);  // ten times slower than expected, on the host and not on the device
  EXPECT_THAT(eta.SecondsLeft(50), Optional(DoubleNear(50 + 100 + 10, 1e-6)));
}

TEST(JobEta, NumbersPlannedStagesOnly) {
  JobEta eta;
  eta.Plan(kPlan);
  eta.StartStage(Stage::kSfm, 0);  // skipped: the dataset has poses
  EXPECT_EQ(eta.stage_number(), 0);
  eta.StartStage(Stage::kReconstruct, 1);
  EXPECT_EQ(eta.stage_number(), 2);
  eta.Plan({{.stage = Stage::kReconstruct, .seconds = 10}, {.stage = Stage::kIndex, .seconds = 1}});
  EXPECT_EQ(eta.stage_number(), 1);
  EXPECT_EQ(eta.num_stages(), 2);
}

}  // namespace
}  // namespace pepeseg
