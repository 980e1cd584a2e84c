#include "core/features/checkpoint.h"

#include <gtest/gtest.h>

#include <limits>

#include "core/features/trainer.h"
#include "tests/testing/point_gaussians.h"
#include "tests/testing/run_trainers.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/synthetic_capture.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

// Chunks of 7 steps; smoothing ends with step 20, and the third chunk with it; centroids are
// refreshed every 5 steps from step 24 on.
constexpr FeatureOptions kOptions = {.num_steps = 40,
                                     .num_pixels = 60,
                                     .num_background_pixels = 10,
                                     .num_scales = 5,
                                     .smooth_until = 0.5,
                                     .centroid_from = 0.6,
                                     .centroid_every = 5,
                                     .centroid_pixels = 300,
                                     .centroid_weight_lower = 0.3f,
                                     .steps_per_chunk = 7};

const Capture& Synthetic() {
  static const Capture capture =
      testing::MakeSyntheticScene({.num_views = 6, .num_points = 1500}).capture;
  return capture;
}
const Gaussians& Points() {
  static const Gaussians gaussians = testing::PointGaussians(Synthetic(), 0.06f);
  return gaussians;
}

std::unique_ptr<FeatureTrainer> Fresh(Backend& backend, const FeatureOptions& options = kOptions) {
  return FeatureTrainer::Create(backend, Synthetic(), Points(), options).value();
}

absl::Status Proceed(const StepReport&) { return absl::OkStatus(); }

FeatureCheckpoint CheckpointAt(int step, const FeatureOptions& options = kOptions) {
  const auto backend = MakeCpuBackend(2);
  const auto stage = Fresh(*backend, options);
  while (stage->step() < step) EXPECT_OK(stage->Step());
  return stage->Save().value();
}

// Returns the checkpoint as another process would read it from a file.
FeatureCheckpoint WriteAndRead(const FeatureCheckpoint& checkpoint) {
  const testing::TempFolder folder;
  const std::filesystem::path path = folder.path() / "checkpoint";
  EXPECT_OK(WriteCheckpoint(path, {"features", "", 0}, SectionsOf(checkpoint)));
  const auto file = ReadCheckpoint(path);
  EXPECT_OK(file);
  auto read = FeatureCheckpoint::Read(file->sections);
  EXPECT_OK(read);
  return *std::move(read);
}

TEST(FeatureCheckpoint, ResumesToTheBytesOfAnUnbrokenRun) {
  const auto backend = MakeCpuBackend(2);
  const auto unbroken = Fresh(*backend);
  ASSERT_OK_AND_ASSIGN(const FeatureField want, RunSteps(*unbroken, Proceed));
  // At the start, within chunks and at their ends, around the end of smoothing and the first
  // refresh of the centroids, and at the end.
  for (const int step : {0, 1, 6, 7, 8, 14, 19, 20, 21, 23, 24, 25, 31, 39, 40}) {
    SCOPED_TRACE(step);
    const FeatureCheckpoint checkpoint = WriteAndRead(CheckpointAt(step));
    const auto other = MakeCpuBackend(1);
    ASSERT_OK_AND_ASSIGN(const auto resumed, FeatureTrainer::Resume(*other, Synthetic(), Points(),
                                                                    kOptions, checkpoint));
    EXPECT_EQ(resumed->step(), step);
    ASSERT_OK_AND_ASSIGN(const FeatureField got, RunSteps(*resumed, Proceed));
    EXPECT_EQ(got.features, want.features);
    EXPECT_EQ(got.gate, want.gate);
    EXPECT_EQ(got.scale_quantiles, want.scale_quantiles);
  }
}

// Groups of three steps end early with a chunk, with smoothing, and before centroids are refreshed.
TEST(FeatureCheckpoint, ResumesToTheBytesOfARunOfSeveralStepsAtOnce) {
  const auto backend = MakeCpuBackend(2);
  FeatureOptions options = kOptions;
  options.views_at_once = 3;
  ASSERT_OK_AND_ASSIGN(const FeatureField want, RunSteps(*Fresh(*backend, options), Proceed));
  for (const int step : {3, 7, 20, 24, 37}) {
    SCOPED_TRACE(step);
    const FeatureCheckpoint checkpoint = WriteAndRead(CheckpointAt(step, options));
    ASSERT_OK_AND_ASSIGN(const auto resumed, FeatureTrainer::Resume(*backend, Synthetic(), Points(),
                                                                    options, checkpoint));
    ASSERT_OK_AND_ASSIGN(const FeatureField got, RunSteps(*resumed, Proceed));
    EXPECT_EQ(got.features, want.features);
    EXPECT_EQ(got.gate, want.gate);
  }
}

// Windows of 500 steps (100 rounds of 5 training views). min_loss_fall is 1, so the loss counts as
// converged after the second window, whatever it does.
constexpr FeatureOptions kConverging = {.num_steps = 2000,
                                        .num_pixels = 12,
                                        .num_background_pixels = 4,
                                        .num_scales = 2,
                                        .fine_first = 0,
                                        .centroid_weight_upper = 0,
                                        .steps_per_chunk = 300,
                                        .min_loss_fall = 1,
                                        .closing_share = 0.3};

TEST(FeatureTrainer, LeavesOutStepsAfterConvergenceAlsoWhenResumed) {
  const auto backend = MakeCpuBackend(2);
  ASSERT_OK_AND_ASSIGN(const auto unbroken,
                       FeatureTrainer::Create(*backend, Synthetic(), Points(), kConverging));
  StepReport last;
  ASSERT_OK_AND_ASSIGN(const FeatureField want, RunSteps(*unbroken, [&](const StepReport& r) {
                         last = r;
                         return absl::OkStatus();
                       }));
  const SkippedPart& steps = unbroken->skipped().back();
  EXPECT_EQ(steps.part, Part::kSteps);
  EXPECT_EQ(steps.step, 1000);  // the end of the second window
  EXPECT_EQ(steps.saved_steps, 400);
  EXPECT_EQ(last.step, 1600);
  EXPECT_EQ(last.num_steps, 1600);
  ASSERT_OK_AND_ASSIGN(const auto stage,
                       FeatureTrainer::Create(*backend, Synthetic(), Points(), kConverging));
  for (const int step : {499, 500, 999, 1000, 1001, 1350}) {
    SCOPED_TRACE(step);
    while (stage->step() < step) ASSERT_OK(stage->Step());
    ASSERT_OK_AND_ASSIGN(const FeatureCheckpoint checkpoint, stage->Save());
    ASSERT_OK_AND_ASSIGN(const auto resumed, FeatureTrainer::Resume(*backend, Synthetic(), Points(),
                                                                    kConverging, checkpoint));
    ASSERT_OK_AND_ASSIGN(const FeatureField got, RunSteps(*resumed, Proceed));
    EXPECT_EQ(resumed->step(), 1600);
    EXPECT_EQ(got.features, want.features);
    EXPECT_EQ(got.gate, want.gate);
  }
}

// Fine masks go first until step 700, that is in the first two windows of 500 steps. The third is
// the first that counts, and the fourth the first that is compared.
TEST(FeatureTrainer, JudgesConvergenceOnlyAfterFineMasksWentFirst) {
  const auto backend = MakeCpuBackend(2);
  FeatureOptions options = kConverging;
  options.num_steps = 2800;
  options.fine_first = 0.25;
  options.closing_share = 0.2;
  ASSERT_OK_AND_ASSIGN(const auto stage,
                       FeatureTrainer::Create(*backend, Synthetic(), Points(), options));
  ASSERT_OK(RunSteps(*stage, Proceed));
  const SkippedPart& steps = stage->skipped().back();
  EXPECT_EQ(steps.part, Part::kSteps);
  EXPECT_EQ(steps.step, 2000);
  EXPECT_EQ(steps.saved_steps, 240);
}

TEST(FeatureTrainer, DoesAllStepsWithoutAMinLossFall) {
  const auto backend = MakeCpuBackend(2);
  FeatureOptions options = kConverging;
  options.num_steps = 1200;
  options.min_loss_fall = 0;
  ASSERT_OK_AND_ASSIGN(const auto stage,
                       FeatureTrainer::Create(*backend, Synthetic(), Points(), options));
  ASSERT_OK(RunSteps(*stage, Proceed));
  EXPECT_EQ(stage->step(), 1200);
}

TEST(FeatureCheckpoint, IsTheSameWhenSavedAgainAfterResuming) {
  const FeatureCheckpoint first = CheckpointAt(30);
  EXPECT_FALSE(first.centroids.upper.empty() && first.centroids.lower.empty());
  const auto backend = MakeCpuBackend(2);
  ASSERT_OK_AND_ASSIGN(const auto stage,
                       FeatureTrainer::Resume(*backend, Synthetic(), Points(), kOptions, first));
  ASSERT_OK_AND_ASSIGN(const FeatureCheckpoint again, stage->Save());
  EXPECT_EQ(again.drawer.random, first.drawer.random);
  EXPECT_EQ(again.drawer.views_left, first.drawer.views_left);
  EXPECT_EQ(again.centroids.upper, first.centroids.upper);
  EXPECT_EQ(again.rows.features, first.rows.features);
  EXPECT_EQ(again.rows.last_step, first.rows.last_step);
  EXPECT_EQ(again.counters.steps_of_chunk, first.counters.steps_of_chunk);
}

TEST(FeatureCheckpoint, RefusesStatesThatDoNotFit) {
  const FeatureCheckpoint good = CheckpointAt(9);
  const auto backend = MakeCpuBackend(1);
  const auto resume = [&](const FeatureCheckpoint& checkpoint) {
    return FeatureTrainer::Resume(*backend, Synthetic(), Points(), kOptions, checkpoint).status();
  };
  EXPECT_OK(resume(good));
  FeatureCheckpoint bad = good;
  bad.rows.moment1[5] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_STATUS(resume(bad), absl::StatusCode::kDataLoss, "moment1[5]");
  bad = good;
  bad.rows.gate.pop_back();
  EXPECT_STATUS(resume(bad), absl::StatusCode::kDataLoss, "gate has 63 values");
  FeatureOptions two_layers = kOptions;
  two_layers.gate_layers = 2;
  EXPECT_STATUS(FeatureTrainer::Resume(*backend, Synthetic(), Points(), two_layers, good).status(),
                absl::StatusCode::kDataLoss, "the gate has 64 numbers");
  bad = good;
  bad.counters.step = 41;
  EXPECT_STATUS(resume(bad), absl::StatusCode::kDataLoss, "step 41");
  bad = good;
  bad.counters.num_gaussians = 3;
  EXPECT_STATUS(resume(bad), absl::StatusCode::kDataLoss, "last_step has");
  bad = good;
  bad.drawer.views_left = {77};
  EXPECT_STATUS(resume(bad), absl::StatusCode::kDataLoss, "view 77");
  bad = good;
  bad.drawer.random = "no numbers";
  EXPECT_STATUS(resume(bad), absl::StatusCode::kDataLoss, "random numbers");
  bad = good;
  bad.centroids.lower = {1, 2, 3};
  EXPECT_STATUS(resume(bad), absl::StatusCode::kDataLoss, "centroids_lower has 3");
}

TEST(FeatureCheckpoint, RefusesUnknownAndMissingSections) {
  const FeatureCheckpoint checkpoint = CheckpointAt(3);
  std::vector<CheckpointSection> sections = SectionsOf(checkpoint);
  EXPECT_OK(FeatureCheckpoint::Read(sections));
  sections.push_back({"new", 1, ""});
  EXPECT_STATUS(FeatureCheckpoint::Read(sections), absl::StatusCode::kDataLoss, "sections");
  sections.pop_back();
  sections[0].version = 99;
  EXPECT_STATUS(FeatureCheckpoint::Read(sections), absl::StatusCode::kDataLoss, "version 99");
  sections.erase(sections.begin());
  EXPECT_STATUS(FeatureCheckpoint::Read(sections), absl::StatusCode::kDataLoss, "missing");
}

}  // namespace
}  // namespace pepeseg
