#include "core/priors/sam/joined_masks.h"

#include <gtest/gtest.h>

#include <vector>

namespace pepeseg {
namespace {

constexpr int kWidth = 8, kHeight = 4;

// The columns [first, last) of every row.
BinaryMask Columns(int first, int last) {
  BinaryMask mask;
  for (int i = 0; i < kWidth * kHeight; ++i) {
    mask.pixels.push_back(i % kWidth >= first && i % kWidth < last ? 1 : 0);
  }
  return mask;
}

MaskSet Set(const std::vector<BinaryMask>& masks) { return BuildMaskSet(kWidth, kHeight, masks); }

TEST(JoinMasks, DropsWhatIsNearlyTheSameAsAMaskBefore) {
  const MaskSet joined = JoinMasks(Set({Columns(0, 5)}), Set({Columns(0, 6), Columns(2, 8)}), {},
                                   /*duplicate_iou=*/0.8);
  ASSERT_EQ(joined.num_masks, 2);
  EXPECT_EQ(joined.Extract(0).pixels, Columns(0, 5).pixels);
  EXPECT_EQ(joined.Extract(1).pixels, Columns(2, 8).pixels);
}

TEST(JoinMasks, LeavesIgnoredPixelsOut) {
  const std::vector<uint8_t> ignore = Columns(4, 8).pixels;
  const MaskSet joined = JoinMasks(Set({Columns(2, 6), Columns(5, 7)}), {}, ignore, 0.8);
  ASSERT_EQ(joined.num_masks, 1);
  EXPECT_EQ(joined.Extract(0).pixels, Columns(2, 4).pixels);
}

}  // namespace
}  // namespace pepeseg
