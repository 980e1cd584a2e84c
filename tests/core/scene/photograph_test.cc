#include "core/scene/photograph.h"

#include <gtest/gtest.h>

#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using Eigen::Vector2d;

// Returns a photograph whose file stores 4 x 3 pixels.
Photograph Turned(int orientation) {
  Photograph photograph;
  photograph.lens = {.width = 4, .height = 3, .fx = 4, .fy = 4, .cx = 2, .cy = 1.5};
  photograph.orientation = orientation;
  photograph.width = 4;
  photograph.height = 3;
  return photograph;
}

// Cases are EXIF 2.3's table of Orientation: the sides of the upright photograph at which the first
// stored scanline and column are.
TEST(Photograph, ConvertsPixelsByExifOrientation) {
  const struct {
    int orientation;
    Vector2d first;  // upright position of the centre of the first stored pixel
    Vector2d right;  // step from there to its right neighbour in storage
  } cases[] = {
      {1, {0.5, 0.5}, {1, 0}},  {2, {3.5, 0.5}, {-1, 0}}, {3, {3.5, 2.5}, {-1, 0}},
      {4, {0.5, 2.5}, {1, 0}},  {5, {0.5, 0.5}, {0, 1}},  {6, {2.5, 0.5}, {0, 1}},
      {7, {2.5, 3.5}, {0, -1}}, {8, {0.5, 3.5}, {0, -1}},
  };
  for (const auto& c : cases) {
    const Photograph photograph = Turned(c.orientation);
    EXPECT_EQ(photograph.UprightWidth(), c.orientation < 5 ? 4 : 3);
    EXPECT_EQ(photograph.UprightHeight(), c.orientation < 5 ? 3 : 4);
    EXPECT_EQ(photograph.ToUpright({0.5, 0.5}), c.first) << c.orientation;
    EXPECT_EQ(photograph.ToUpright({1.5, 0.5}), c.first + c.right) << c.orientation;
    for (const Vector2d& stored : {Vector2d(0.25, 1.75), Vector2d(3.5, 0), Vector2d(4, 3)}) {
      EXPECT_EQ(photograph.ToStored(photograph.ToUpright(stored)), stored) << c.orientation;
    }
  }
}

TEST(Photograph, RejectsRectanglesOutsideAndUnknownOrientations) {
  EXPECT_OK(Validate(Turned(1)));
  EXPECT_STATUS(Validate(Turned(0)), absl::StatusCode::kInvalidArgument, "orientation 0");
  EXPECT_STATUS(Validate(Turned(9)), absl::StatusCode::kInvalidArgument, "orientation 9");
  Photograph outside = Turned(1);
  outside.left = 1;
  EXPECT_STATUS(Validate(outside), absl::StatusCode::kInvalidArgument, "4x3 pixels at 1,0");
  outside.width = 0;
  EXPECT_STATUS(Validate(outside), absl::StatusCode::kInvalidArgument, "empty");
}

}  // namespace
}  // namespace pepeseg
