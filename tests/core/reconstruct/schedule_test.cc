#include "core/reconstruct/schedule.h"

#include <gtest/gtest.h>

namespace pepeseg {
namespace {

TEST(Schedule, MeanRateFallsLogLinearlyInSharesOfTheRun) {
  for (const int num_steps : {200, 30000}) {
    ReconstructOptions options;
    options.num_steps = num_steps;
    options.mean_learning_rate = 1e-2f;
    options.mean_learning_rate_final = 1e-4f;
    const Schedule schedule(options, 3.0);
    EXPECT_NEAR(schedule.RatesAt(0).mean, 3e-2, 1e-7);
    EXPECT_NEAR(schedule.RatesAt(num_steps / 2).mean, 3e-3, 1e-8);
    EXPECT_NEAR(schedule.RatesAt(num_steps).mean, 3e-4, 1e-9);
    EXPECT_EQ(schedule.RatesAt(num_steps / 2).sh_dc, options.sh_learning_rate);
    EXPECT_FLOAT_EQ(schedule.RatesAt(0).sh_rest, options.sh_learning_rate / 20);
  }
}

TEST(Schedule, ShDegreeRisesToItsLimit) {
  ReconstructOptions options;
  options.num_steps = 3000;
  options.sh_degree = 2;
  const Schedule schedule(options, 1);
  EXPECT_EQ(schedule.ShDegreeAt(0), 0);
  EXPECT_EQ(schedule.ShDegreeAt(99), 0);
  EXPECT_EQ(schedule.ShDegreeAt(100), 1);
  EXPECT_EQ(schedule.ShDegreeAt(200), 2);
  EXPECT_EQ(schedule.ShDegreeAt(2999), 2);
}

TEST(Schedule, PhotographsGrowFromAQuarterToFullSize) {
  ReconstructOptions options;
  options.num_steps = 1000;
  EXPECT_EQ(Schedule(options, 1).ShrinkAt(0), 1);
  options.coarse_until = 0.4;
  const Schedule schedule(options, 1);
  EXPECT_EQ(schedule.ShrinkAt(0), 4);
  EXPECT_EQ(schedule.ShrinkAt(199), 4);
  EXPECT_EQ(schedule.ShrinkAt(200), 2);
  EXPECT_EQ(schedule.ShrinkAt(399), 2);
  EXPECT_EQ(schedule.ShrinkAt(400), 1);
}

}  // namespace
}  // namespace pepeseg
