#include "core/train/previews.h"

#include <gtest/gtest.h>

#include <random>

#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

TEST(PreviewSchedule, IsDueAtOnceAndThenEveryTwoSeconds) {
  PreviewSchedule schedule;
  EXPECT_TRUE(schedule.Due(0));
  schedule.Record(0.5, 0.501);
  EXPECT_FALSE(schedule.Due(2.49));
  EXPECT_TRUE(schedule.Due(2.5));
}

TEST(PreviewSchedule, HasSomeDozensInAnHour) {
  PreviewSchedule schedule;
  int num_shown = 0;
  for (double seconds = 0; seconds < 3600; seconds += 0.05) {
    if (!schedule.Due(seconds)) continue;
    schedule.Record(seconds, seconds + 0.01);
    ++num_shown;
  }
  EXPECT_GE(num_shown, 55);
  EXPECT_LE(num_shown, 70);
}

TEST(PreviewSchedule, TakesAtMostAHundredthOfTheTime) {
  PreviewSchedule schedule;
  schedule.Record(0, 0.1);
  EXPECT_FALSE(schedule.Due(10.0));
  EXPECT_TRUE(schedule.Due(10.2));
}

TEST(PreviewView, IsTheTrainingViewInTheMiddle) {
  Capture capture;
  for (const double x : {0.0, 10.0, 4.9, 5.0, 5.2}) {
    View view;
    view.cam_from_world.translation = {-x, 0, 0};
    view.held_out = x == 5.0;
    capture.views.push_back(view);
  }
  EXPECT_EQ(PreviewView(capture), 2u);  // the mean without the held-out view is 5.025
}

TEST(PreviewCamera, KeepsTheFieldOfView) {
  const Camera camera = {.width = 1153, .height = 864, .fx = 900, .fy = 901, .cx = 570, .cy = 430};
  const Camera small = PreviewCamera(camera);
  EXPECT_EQ(small.width, kMaxPreviewSide);
  EXPECT_EQ(small.height, 480);
  EXPECT_NEAR(small.fx / small.width, camera.fx / camera.width, 1e-9);
  EXPECT_NEAR(small.cy / small.height, camera.cy / camera.height, 1e-9);
  EXPECT_EQ(PreviewCamera(small), small);
}

// Noise is what JPEG compresses least.
TEST(EncodePreview, FitsNoiseIntoTheLimit) {
  Image image = {640, 480, 3, std::vector<uint8_t>(size_t{3} * 640 * 480)};
  std::minstd_rand random(1);
  for (uint8_t& value : image.pixels) value = static_cast<uint8_t>(random() >> 8);
  ASSERT_OK_AND_ASSIGN(const std::string jpeg, EncodePreview(image));
  EXPECT_LE(jpeg.size(), kMaxPreviewBytes);
  EXPECT_LT(image.width, 640);
  EXPECT_GT(image.width, 100);
}

}  // namespace
}  // namespace pepeseg
