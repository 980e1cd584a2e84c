#include "core/train/photograph_masks.h"

#include <gtest/gtest.h>

#include <optional>
#include <vector>

namespace pepeseg {
namespace {

TEST(MaskWarp, TurnsMasksOfTheUprightPhotographToTheView) {
  View view;
  view.camera = {.width = 4, .height = 3, .fx = 4, .fy = 4, .cx = 2, .cy = 1.5};
  Lens lens;
  lens.width = 4, lens.height = 3, lens.fx = lens.fy = 4, lens.cx = 2, lens.cy = 1.5;
  view.photograph = Photograph{lens, 6, 0, 0, 4, 3};
  // Upright, the photograph is 3x4; its first stored pixel is at the right of the first scanline.
  BinaryMask mask{std::vector<uint8_t>(12, 0)};
  mask.pixels[2] = 1;
  const MaskSet upright = BuildMaskSet(3, 4, {{mask}});
  MaskWarp warp;
  const MaskSet stored = warp.ToView(upright, view);
  ASSERT_EQ(stored.width, 4);
  ASSERT_EQ(stored.height, 3);
  EXPECT_EQ(stored.mask_area, (std::vector<int64_t>{1}));
  EXPECT_TRUE(stored.Covers(0, 0, 0));
}

}  // namespace
}  // namespace pepeseg
