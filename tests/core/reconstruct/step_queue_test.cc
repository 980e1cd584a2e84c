#include "core/reconstruct/step_queue.h"

#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "core/evaluate/image_scores.h"
#include "core/reconstruct/trainer.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/synthetic_capture.h"

namespace pepeseg {
namespace {

using testing::SyntheticCapture;

// Density control comes after steps 10, 20, ... 50; the stage reviews what a scene needs after
// each window of steps.
ReconstructOptions Options(int views_at_once) {
  ReconstructOptions options;
  options.num_steps = 60;
  options.densify_from = 0;
  options.densify_until = 0.9;
  options.densify_every = 10;
  options.views_at_once = views_at_once;
  return options;
}

// Returns the steps done after each call of Step.
std::vector<int64_t> StepsDone(GaussianTrainer& trainer) {
  std::vector<int64_t> done;
  while (!trainer.done()) {
    const auto report = trainer.Step();
    EXPECT_OK(report);
    if (!report.ok()) break;
    done.push_back(report->back().step);
  }
  return done;
}

TEST(StepsAtOnce, AreOneOnACpuUnlessAskedFor) {
  const auto backend = MakeCpuBackend(2);
  EXPECT_EQ(StepsAtOnce(backend->num_branches(), Options(0), 100'000), 1);
  EXPECT_EQ(StepsAtOnce(backend->num_branches(), Options(3), 100'000), 3);
}

TEST(StepsAtOnce, FillADeviceWithBranches) {
  EXPECT_EQ(StepsAtOnce(8, Options(0), 100'000), 4);
  EXPECT_EQ(StepsAtOnce(8, Options(0), 300'000), 3);
  EXPECT_EQ(StepsAtOnce(2, Options(0), 300'000), 2);
  EXPECT_EQ(StepsAtOnce(8, Options(0), 2'000'000), 1);
}

TEST(StepsAtOnce, AreOneWithADepthLoss) {
  ReconstructOptions options = Options(3);
  options.depth_weight = 0.05f;
  EXPECT_EQ(StepsAtOnce(8, options, 100'000), 1);
}

TEST(StepsAtOnce, EndWhereDensityControlIsDue) {
  const auto backend = MakeCpuBackend(2);
  ASSERT_OK_AND_ASSIGN(const auto trainer,
                       GaussianTrainer::Create(*backend, SyntheticCapture(), Options(4)));
  const std::vector<int64_t> done = StepsDone(*trainer);
  ASSERT_GE(done.size(), 6u);
  EXPECT_EQ(std::vector<int64_t>(done.begin(), done.begin() + 6),
            (std::vector<int64_t>{4, 8, 10, 14, 18, 20}));
  EXPECT_EQ(done.back(), 60);
}

// The sizes change after steps 15 and 30.
TEST(StepsAtOnce, EndWhereThePhotographsGrow) {
  const auto backend = MakeCpuBackend(2);
  ReconstructOptions options = Options(4);
  options.coarse_until = 0.5;
  ASSERT_OK_AND_ASSIGN(const auto trainer,
                       GaussianTrainer::Create(*backend, SyntheticCapture(), options));
  const std::vector<int64_t> done = StepsDone(*trainer);
  ASSERT_GE(done.size(), 7u);
  EXPECT_EQ(std::vector<int64_t>(done.begin(), done.begin() + 7),
            (std::vector<int64_t>{4, 8, 10, 14, 15, 19, 20}));
}

// A CPU does one step at a time unless asked for more, and then as many at each size.
TEST(StepsAtOnce, HaveASlotEachOfTheLargestSizeTheyNeed) {
  const auto backend = MakeCpuBackend(2);
  ReconstructOptions options = Options(3);
  EXPECT_EQ(SlotPixels(*backend, options, 1600), (std::vector<int64_t>{1600, 1600, 1600}));
  options.coarse_until = 0.5;
  EXPECT_EQ(SlotPixels(*backend, options, 1600), (std::vector<int64_t>{1600, 1600, 1600}));
}

TEST(StepsAtOnce, ResumeToTheSameBytes) {
  const auto backend = MakeCpuBackend(2);
  ASSERT_OK_AND_ASSIGN(const auto unbroken,
                       GaussianTrainer::Create(*backend, SyntheticCapture(), Options(4)));
  ASSERT_OK_AND_ASSIGN(const auto broken,
                       GaussianTrainer::Create(*backend, SyntheticCapture(), Options(4)));
  for (int call = 0; call < 5; ++call) ASSERT_OK(broken->Step());
  ASSERT_OK_AND_ASSIGN(const GaussianCheckpoint checkpoint, broken->Save());
  EXPECT_EQ(checkpoint.counters.step, 18);
  ASSERT_OK_AND_ASSIGN(const auto resumed, GaussianTrainer::Resume(*backend, SyntheticCapture(),
                                                                   Options(4), checkpoint));
  StepsDone(*unbroken);
  StepsDone(*resumed);
  EXPECT_EQ(resumed->Result().planes, unbroken->Result().planes);
}

// Each step takes its view, rates and dropout from its own position, so that the first steps, which
// hardly move, differ from steps one after the other by little.
TEST(StepsAtOnce, DoWhatStepsOneAfterTheOtherDo) {
  const auto backend = MakeCpuBackend(2);
  const auto psnr_of = [&](int views_at_once) {
    ReconstructOptions options = Options(views_at_once);
    options.num_steps = 200;
    const auto trainer = GaussianTrainer::Create(*backend, SyntheticCapture(), options).value();
    StepsDone(*trainer);
    const Gaussians gaussians = trainer->Result();
    return Mean(ScoreHeldOut(*backend, SyntheticCapture(), gaussians).value()).psnr;
  };
  const double one = psnr_of(1), four = psnr_of(4);
  EXPECT_NEAR(four, one, 1.0);
  EXPECT_NE(four, one);
}

}  // namespace
}  // namespace pepeseg
