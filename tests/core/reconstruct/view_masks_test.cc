#include "core/reconstruct/view_masks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace pepeseg {
namespace {

TEST(ViewMasks, HoldsThePatchMapsOfTheTrainingViews) {
  Capture capture;
  capture.views.resize(3);
  capture.views[0].held_out = true;
  const std::vector<BinaryMask> masks = {{{1, 1, 0, 0}}, {{0, 1, 1, 0}}};
  capture.views[0].masks = capture.views[2].masks = BuildMaskSet(2, 2, masks);
  const auto backend = MakeCpuBackend(1);
  const ViewMasks view_masks(*backend, capture);
  EXPECT_TRUE(view_masks.any());
  EXPECT_TRUE(view_masks.allocated());
  EXPECT_FALSE(view_masks.HasMasks(0));
  ASSERT_TRUE(view_masks.HasMasks(1));
  const PatchMap map = view_masks.At(1);
  EXPECT_EQ(map.words, 1);
  const uint64_t want[] = {0b01, 0b11, 0b10, 0};
  for (int i = 0; i < 4; ++i) EXPECT_EQ(map.patch_bits[map.pixel_patch[i]], want[i]);
  EXPECT_EQ(map.mask_area[0], 2);
  EXPECT_EQ(map.mask_area[1], 2);
}

TEST(ViewMasks, TellsThatThereAreNone) {
  Capture capture;
  capture.views.resize(2);
  const auto backend = MakeCpuBackend(1);
  EXPECT_FALSE(ViewMasks(*backend, capture).any());
}

}  // namespace
}  // namespace pepeseg
