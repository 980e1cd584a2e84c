#include "core/reconstruct/few_visits.h"

#include <gtest/gtest.h>

#include <cmath>

namespace pepeseg {
namespace {

constexpr double kSmall = 100'000, kMegapixel = 1e6;

ReconstructOptions WithSteps(int num_steps) {
  ReconstructOptions options;
  options.num_steps = num_steps;
  options.few_visits = 90;
  return options;
}

TEST(FewVisits, LeaveEnoughVisitsAsTheyAre) {
  const ReconstructOptions options = WithSteps(18'000);
  const ReconstructOptions same = WithFewVisits(options, {200, kMegapixel});
  EXPECT_EQ(same.num_steps, options.num_steps);
  EXPECT_EQ(same.mean_learning_rate, options.mean_learning_rate);
  EXPECT_EQ(same.log_scale_learning_rate, options.log_scale_learning_rate);
  EXPECT_EQ(same.sh_learning_rate, options.sh_learning_rate);
  EXPECT_EQ(same.densify_gradient, options.densify_gradient);
  EXPECT_EQ(same.second_moment_decay, options.second_moment_decay);
  EXPECT_EQ(same.dropout, options.dropout);
}

TEST(FewVisits, ChangeNothingAtZero) {
  ReconstructOptions options = WithSteps(100);
  options.few_visits = 0;
  const ReconstructOptions same = WithFewVisits(options, {200, kMegapixel});
  EXPECT_EQ(same.num_steps, 100);
  EXPECT_EQ(same.sh_learning_rate, options.sh_learning_rate);
}

TEST(FewVisits, ChangeNothingOnAHundredViews) {
  const ReconstructOptions options = WithSteps(100);
  const ReconstructOptions same = WithFewVisits(options, {100, kMegapixel});
  EXPECT_EQ(same.num_steps, 100);
  EXPECT_EQ(same.sh_learning_rate, options.sh_learning_rate);
}

TEST(FewVisits, AreWholeFromAThirdOn) {
  const ReconstructOptions options = WithSteps(6000);
  for (const double num_views : {200.0, 2000.0}) {
    const ReconstructOptions raised = WithFewVisits(options, {num_views, kSmall});
    EXPECT_FLOAT_EQ(raised.mean_learning_rate, 2 * options.mean_learning_rate);
    EXPECT_FLOAT_EQ(raised.mean_learning_rate_final, 2 * options.mean_learning_rate_final);
    EXPECT_FLOAT_EQ(raised.log_scale_learning_rate, 3 * options.log_scale_learning_rate);
    EXPECT_FLOAT_EQ(raised.sh_learning_rate, 3 * options.sh_learning_rate);
    EXPECT_FLOAT_EQ(raised.densify_gradient, options.densify_gradient / 4);
    EXPECT_NEAR(raised.second_moment_decay, 0.99, 1e-6);
    EXPECT_EQ(raised.dropout, 0);
  }
}

TEST(FewVisits, GrowWithTheLogarithmOfWhatIsMissing) {
  const ReconstructOptions options = WithSteps(10'392);  // visits: 90 / sqrt(3)
  const ReconstructOptions raised = WithFewVisits(options, {200, kSmall});
  EXPECT_NEAR(raised.sh_learning_rate, std::sqrt(3.0) * options.sh_learning_rate, 1e-6);
  EXPECT_NEAR(raised.dropout, options.dropout / 2, 1e-4);
}

TEST(FewVisits, SaveStepsOnLargePhotographsOnly) {
  ReconstructOptions options = WithSteps(6000);
  options.megapixels_per_step = 0.8;
  EXPECT_EQ(WithFewVisits(options, {200, kSmall}).num_steps, 6000);
  EXPECT_EQ(WithFewVisits(options, {200, kMegapixel}).num_steps, 4800);
  EXPECT_EQ(WithFewVisits(options, {200, 8 * kMegapixel}).num_steps, 4200);
  options.coarse_until = kMaxCoarseUntil;
  EXPECT_EQ(WithFewVisits(options, {200, 80 * kMegapixel}).num_steps, 6000);
  options.coarse_until = 0;
  options.megapixels_per_step = 0;
  EXPECT_EQ(WithFewVisits(options, {200, 8 * kMegapixel}).num_steps, 6000);
  options = WithSteps(12'000);  // more than half of few_visits
  EXPECT_EQ(WithFewVisits(options, {200, kMegapixel}).num_steps, 12'000);
}

}  // namespace
}  // namespace pepeseg
