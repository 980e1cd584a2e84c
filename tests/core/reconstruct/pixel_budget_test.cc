#include "core/reconstruct/pixel_budget.h"

#include <gtest/gtest.h>

namespace pepeseg {
namespace {

constexpr double kViewPixels = 1e6;

// Returns the pixels that the steps of these options render, in millions, as Schedule::ShrinkAt
// shrinks photographs.
double Megapixels(const ReconstructOptions& options) {
  const double coarse = options.coarse_until;
  return options.num_steps * (coarse / 2 / 16 + coarse / 2 / 4 + (1 - coarse));
}

ReconstructOptions Options() {
  ReconstructOptions options;
  options.num_steps = 1000;
  options.coarse_until = 0.5;
  options.pixels_per_gaussian = 50;
  return options;
}

TEST(PixelBudget, KeepsTheScheduleOfStepsThatFit) {
  ReconstructOptions options = Options();
  options.max_megapixels = Megapixels(options) + 1;
  EXPECT_EQ(WithPixelBudget(options, kViewPixels).coarse_until, 0.5);
  EXPECT_EQ(WithPixelBudget(options, kViewPixels).pixels_per_gaussian, 50);
}

TEST(PixelBudget, IsUnlimitedAtZero) {
  ReconstructOptions options = Options();
  options.max_megapixels = 0;
  EXPECT_EQ(WithPixelBudget(options, 1e9).coarse_until, 0.5);
  EXPECT_EQ(WithPixelBudget(options, 1e9).pixels_per_gaussian, 50);
}

TEST(PixelBudget, IsSpentByTheRaisedSchedule) {
  ReconstructOptions options = Options();
  for (const double budget : {500.0, 400.0, 300.0}) {
    options.max_megapixels = budget;
    EXPECT_NEAR(Megapixels(WithPixelBudget(options, kViewPixels)), budget, 1e-6);
  }
}

TEST(PixelBudget, LeavesTheLastStepsAtFullSize) {
  ReconstructOptions options = Options();
  options.max_megapixels = 1;
  EXPECT_EQ(WithPixelBudget(options, kViewPixels).coarse_until, kMaxCoarseUntil);
  options.coarse_until = 0.98;
  EXPECT_EQ(WithPixelBudget(options, kViewPixels).coarse_until, 0.98);
}

// From coarse_until 0.5 to 0.75 is half of the way to 1, where the factor would be 4.
TEST(PixelBudget, GivesAGaussianMorePixelsWithEachStepMoved) {
  ReconstructOptions options = Options();
  options.max_megapixels = 1000 * (1 - 0.75 * 27 / 32);
  EXPECT_NEAR(WithPixelBudget(options, kViewPixels).coarse_until, 0.75, 1e-9);
  EXPECT_NEAR(WithPixelBudget(options, kViewPixels).pixels_per_gaussian, 100, 1e-6);
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
  ReconstructOptions options = Options();
  options.max_megapixels = 600;
  EXPECT_EQ(WithPixelBudget(options, capture).coarse_until,
            WithPixelBudget(options, 2e6).coarse_until);
  EXPECT_GT(WithPixelBudget(options, capture).coarse_until, 0.5);
}

}  // namespace
}  // namespace pepeseg
