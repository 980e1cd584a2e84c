#include "core/reconstruct/schedule.h"

#include <gtest/gtest.h>

#include <cmath>

namespace pepeseg {
namespace {

TEST(Schedule, LowersTheRateOfMeansLogLinearly) {
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

TEST(Schedule, RaisesTheRateOfMeansToAShareOfAPixel) {
  ReconstructOptions options;
  options.num_steps = 1000;
  options.mean_learning_rate = 1e-4f;
  options.mean_learning_rate_final = 1e-5f;
  options.mean_rate_pixels = 0.1f;
  const Schedule schedule(options, 3.0, 0.02);
  EXPECT_NEAR(schedule.RatesAt(0).mean, 2e-3, 1e-9);
  EXPECT_NEAR(schedule.RatesAt(1000).mean, 2e-4, 1e-10);  // the same ratio of end to start
  // Without points the span is not known.
  EXPECT_NEAR(Schedule(options, 3.0).RatesAt(0).mean, 3e-4, 1e-10);
  options.mean_rate_pixels = 0;
  EXPECT_NEAR(Schedule(options, 3.0, 0.02).RatesAt(0).mean, 3e-4, 1e-10);
}

TEST(Schedule, LowersTheOtherRatesAtTheEnd) {
  ReconstructOptions options;
  options.num_steps = 1000;
  options.rates_fall_from = 0.8;
  const Schedule schedule(options, 1);
  EXPECT_EQ(schedule.RatesAt(800).opacity, options.opacity_learning_rate);
  const float tenth_root = std::sqrt(0.1f);
  const LearningRates middle = schedule.RatesAt(900), last = schedule.RatesAt(1000);
  EXPECT_FLOAT_EQ(middle.opacity, tenth_root * options.opacity_learning_rate);
  EXPECT_FLOAT_EQ(last.log_scale, 0.1f * options.log_scale_learning_rate);
  EXPECT_FLOAT_EQ(last.rotation, 0.1f * options.rotation_learning_rate);
  EXPECT_FLOAT_EQ(last.sh_dc, 0.1f * options.sh_learning_rate);
  EXPECT_FLOAT_EQ(last.sh_rest, 0.1f * options.sh_learning_rate / 20);
  options.rates_fall_from = 1;
  EXPECT_EQ(Schedule(options, 1).RatesAt(1000).opacity, options.opacity_learning_rate);
}

TEST(Schedule, CapsTheRateOfMeansAtAPixel) {
  ReconstructOptions options;
  options.num_steps = 1000;
  options.mean_learning_rate = 1e-2f;
  options.mean_learning_rate_final = 1e-4f;
  const Schedule schedule(options, 3.0, 2e-3);
  EXPECT_NEAR(schedule.RatesAt(0).mean, 2e-3, 1e-9);
  EXPECT_NEAR(schedule.RatesAt(500).mean, 2e-4, 1e-10);
  EXPECT_NEAR(Schedule(options, 3.0, 0.04).RatesAt(0).mean, 3e-2, 1e-7);
  options.mean_learning_rate_cap = 2;  // pixels
  EXPECT_NEAR(Schedule(options, 3.0, 2e-3).RatesAt(0).mean, 4e-3, 1e-9);
  options.mean_learning_rate_cap = 0;  // no cap
  EXPECT_NEAR(Schedule(options, 3.0, 2e-3).RatesAt(0).mean, 3e-2, 1e-7);
}

TEST(Schedule, RaisesTheShDegreeToItsLimit) {
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

TEST(Schedule, LowersTheDepthWeightAlongAReversedSigmoid) {
  ReconstructOptions options;
  options.num_steps = 1000;
  options.depth_weight = 0.05f;
  options.depth_weight_final = 0.01f;
  const Schedule schedule(options, 1);
  EXPECT_FLOAT_EQ(schedule.DepthWeightAt(0), 0.05f);
  EXPECT_NEAR(schedule.DepthWeightAt(100), 0.05f, 5e-4f);
  EXPECT_NEAR(schedule.DepthWeightAt(500), 0.03f, 1e-6f);
  EXPECT_NEAR(schedule.DepthWeightAt(999), 0.01f, 1e-4f);
  for (int step = 1; step < 1000; ++step) {
    ASSERT_LT(schedule.DepthWeightAt(step), schedule.DepthWeightAt(step - 1));
  }
}

TEST(Schedule, SetsNegligibleDepthWeightsToZero) {
  ReconstructOptions options;
  options.num_steps = 1000;
  options.depth_weight = 0.05f;
  options.depth_weight_final = 0;
  EXPECT_GT(Schedule(options, 1).DepthWeightAt(700), 0);
  EXPECT_EQ(Schedule(options, 1).DepthWeightAt(999), 0);
  options.depth_weight = 0;
  options.depth_weight_final = 0.02f;
  EXPECT_EQ(Schedule(options, 1).DepthWeightAt(0), 0);
}

TEST(Schedule, EnlargesPhotographsFromAQuarterToFullSize) {
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

Capture ViewsWithFocals(const std::vector<double>& focals) {
  Capture capture;
  for (const double focal : focals) {
    View& view = capture.views.emplace_back();
    view.camera = {640, 480, focal, 0.5 * focal, 320, 240};
    view.cam_from_world.translation = {0, 0, 5};
  }
  return capture;
}

TEST(PixelSpan, IsTheDepthOfThePointsOverTheFocalLength) {
  const Capture capture = ViewsWithFocals({100, 1000, 1e5});
  std::vector<ScenePoint> points;
  // The last two are behind the cameras.
  for (const float z : {-4, 5, 45, -6, -7}) points.push_back({Eigen::Vector3f(1, 2, z), {}});
  EXPECT_NEAR(PixelSpan(capture, points), 10.0 / 1000, 1e-9);
}

TEST(PixelSpan, IsInfiniteWithoutPointsInFrontOfAView) {
  const Capture capture = ViewsWithFocals({100});
  EXPECT_TRUE(std::isinf(PixelSpan(capture, {})));
  EXPECT_TRUE(std::isinf(PixelSpan(capture, {{Eigen::Vector3f(0, 0, -6), {}}})));
  EXPECT_TRUE(std::isinf(PixelSpan(Capture(), {{Eigen::Vector3f(0, 0, 6), {}}})));
}

}  // namespace
}  // namespace pepeseg
