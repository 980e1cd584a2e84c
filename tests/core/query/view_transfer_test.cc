#include "core/query/view_transfer.h"

#include <gtest/gtest.h>

namespace pepeseg {
namespace {

// A camera of 8 x 4 pixels that looks along z from (x, 0, 0), and a wall at a depth.
ViewDepth WallFrom(double x, float depth) {
  ViewDepth view;
  view.view.camera = {.width = 8, .height = 4, .fx = 4, .fy = 4, .cx = 4, .cy = 2};
  view.view.cam_from_world.translation.x() = -x;
  view.depth.assign(32, depth);
  return view;
}

// One pixel is 0.5 units wide on a wall at depth 2.
TEST(TransferMap, ShiftsWithTheCamera) {
  std::vector<uint8_t> mask(32);
  mask[8 + 3] = mask[8 + 4] = 7;
  const TransferredMap got = TransferMap(WallFrom(0, 2), mask, WallFrom(1, 2));
  for (int y = 0; y < 4; ++y) {
    for (int x = 0; x < 8; ++x) {
      EXPECT_EQ(got.known[y * 8 + x], x < 6 ? 1 : 0) << x;  // the rest is outside the first view
      EXPECT_EQ(got.values[y * 8 + x], y == 1 && (x == 1 || x == 2) ? 7 : 0) << x << " " << y;
    }
  }
}

TEST(TransferMap, KnowsNothingOfOtherSurfaces) {
  const std::vector<uint8_t> mask(32, 1);
  const ViewDepth from = WallFrom(0, 2);
  EXPECT_EQ(TransferMap(from, mask, WallFrom(0, 2.05F)).known, mask);
  const std::vector<uint8_t> nothing(32);
  // Behind the wall, before it, not rendered.
  for (const float depth : {2.2F, 1.8F, 0.0F}) {
    EXPECT_EQ(TransferMap(from, mask, WallFrom(0, depth)).known, nothing) << depth;
  }
  ViewDepth back = WallFrom(0, 2);  // looks the other way
  back.view.cam_from_world.rotation =
      Eigen::Quaterniond(Eigen::AngleAxisd(3.14159265, Eigen::Vector3d::UnitY()));
  EXPECT_EQ(TransferMap(from, mask, back).known, nothing);
  EXPECT_EQ(TransferMap(WallFrom(0, 0), mask, from).known, nothing);
}

}  // namespace
}  // namespace pepeseg
