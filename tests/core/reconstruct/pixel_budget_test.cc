#include "core/reconstruct/pixel_budget.h"

#include <gtest/gtest.h>

namespace pepeseg {
namespace {

constexpr ViewPixels kViews = {5, 1e6};

// Returns the megapixels that steps of these options render on average, as Schedule::ShrinkAt
// shrinks photographs of a megapixel.
double Megapixels(const ReconstructOptions& options) {
  const double coarse = options.coarse_until;
  return coarse / 2 / 16 + coarse / 2 / 4 + (1 - coarse);
}

ReconstructOptions BudgetOptions() {
  ReconstructOptions options;
  options.num_steps = 1000;
  options.coarse_until = 0.5;
  options.pixels_per_gaussian = 50;
  options.full_size_visits = 0;
  return options;
}

TEST(PixelBudget, KeepsTheScheduleOfStepsThatFit) {
  ReconstructOptions options = BudgetOptions();
  options.megapixels_per_step = Megapixels(options) + 0.001;
  EXPECT_EQ(WithPixelBudget(options, kViews).coarse_until, 0.5);
  EXPECT_EQ(WithPixelBudget(options, kViews).pixels_per_gaussian, 50);
}

TEST(PixelBudget, IsUnlimitedAtZero) {
  ReconstructOptions options = BudgetOptions();
  options.megapixels_per_step = 0;
  EXPECT_EQ(WithPixelBudget(options, {5, 1e9}).coarse_until, 0.5);
  EXPECT_EQ(WithPixelBudget(options, {5, 1e9}).pixels_per_gaussian, 50);
}

TEST(PixelBudget, IsSpentByTheRaisedSchedule) {
  ReconstructOptions options = BudgetOptions();
  for (const double budget : {0.5, 0.4, 0.3}) {
    options.megapixels_per_step = budget;
    EXPECT_NEAR(Megapixels(WithPixelBudget(options, kViews)), budget, 1e-9);
  }
}

TEST(PixelBudget, LeavesTheLastStepsAtFullSize) {
  ReconstructOptions options = BudgetOptions();
  options.megapixels_per_step = 0.001;
  EXPECT_EQ(WithPixelBudget(options, kViews).coarse_until, kMaxCoarseUntil);
  options.coarse_until = 0.98;
  EXPECT_EQ(WithPixelBudget(options, kViews).coarse_until, 0.98);
}

TEST(PixelBudget, LeavesEachPhotographItsStepsAtFullSize) {
  ReconstructOptions options = BudgetOptions();
  options.megapixels_per_step = 0.001;
  options.full_size_visits = 40;  // of 5 photographs in 1,000 steps: a fifth
  EXPECT_DOUBLE_EQ(WithPixelBudget(options, kViews).coarse_until, 0.8);
  options.full_size_visits = 150;
  EXPECT_EQ(WithPixelBudget(options, kViews).coarse_until, 0.5);
  EXPECT_EQ(WithPixelBudget(options, kViews).pixels_per_gaussian, 50);
}

TEST(PixelBudget, AllowsAHalfToManyPhotographs) {
  ReconstructOptions options = BudgetOptions();
  options.coarse_until = 0;
  options.megapixels_per_step = 0.3;
  options.full_size_visits = 80;
  EXPECT_EQ(WithPixelBudget(options, {100, 1e6}).coarse_until, 0);
  EXPECT_EQ(WithPixelBudget(options, {101, 1e6}).coarse_until, 0.5);
  EXPECT_EQ(WithPixelBudget(options, {101, 3e5}).coarse_until, 0);
}

// From coarse_until 0.5 to 0.75 is half of the way to 1, where the factor would be 4.
TEST(PixelBudget, GivesAGaussianMorePixelsWithEachStepMoved) {
  ReconstructOptions options = BudgetOptions();
  options.megapixels_per_step = 1 - 0.75 * 27 / 32;
  EXPECT_NEAR(WithPixelBudget(options, kViews).coarse_until, 0.75, 1e-9);
  EXPECT_NEAR(WithPixelBudget(options, kViews).pixels_per_gaussian, 100, 1e-6);
}

TEST(PixelBudget, CountsThePixelsOfTrainingViews) {
  Capture capture;
  for (const int width : {1000, 3000, 50'000}) {
    View view;
    view.camera.width = width;
    view.camera.height = 1000;
    view.held_out = width == 50'000;
    capture.views.push_back(view);
  }
  ReconstructOptions options = BudgetOptions();
  options.megapixels_per_step = 0.6;
  EXPECT_EQ(WithPixelBudget(options, TrainingViewPixels(capture)).coarse_until,
            WithPixelBudget(options, {2, 2e6}).coarse_until);
  EXPECT_GT(WithPixelBudget(options, TrainingViewPixels(capture)).coarse_until, 0.5);
}

}  // namespace
}  // namespace pepeseg
