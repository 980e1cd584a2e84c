#include <gtest/gtest.h>

#include <numeric>

#include "core/query/mask_geometry.h"

namespace pepeseg {
namespace {

// A result of 40x30 pixels whose mask fills a box; the similarity is 0.5 left of column 20, else 1.
SegmentResult Filled(int left, int top, int right, int bottom) {
  SegmentResult result;
  result.width = 40;
  result.height = 30;
  result.similarity.resize(40 * 30);
  BinaryMask mask = {std::vector<uint8_t>(40 * 30)};
  for (int y = 0; y < 30; ++y) {
    for (int x = 0; x < 40; ++x) {
      mask.pixels[y * 40 + x] = x >= left && x < right && y >= top && y < bottom ? 1 : 0;
      result.similarity[y * 40 + x] = x < 20 ? 0.5F : 1.0F;
    }
  }
  SetMask(std::move(mask), result);
  return result;
}

TEST(SetMask, SetsWhatFollowsFromTheMask) {
  const SegmentResult result = Filled(18, 10, 22, 12);
  EXPECT_EQ(result.area, 8);
  EXPECT_DOUBLE_EQ(result.score, 0.75);
  EXPECT_EQ(result.box[0], 18);
  EXPECT_EQ(result.box[2], 4);
  EXPECT_EQ(Filled(0, 0, 0, 0).score, 0);
}

TEST(CutToBox, KeepsWhatFitsTheBox) {
  SegmentResult result = Filled(8, 8, 22, 22);  // reaches two pixels beyond the box
  EXPECT_NEAR(CutToBox({10, 10, 10, 10}, result), 100.0 / 196, 1e-12);
  EXPECT_EQ(result.area, 196);
}

TEST(CutToBox, CutsALargeMaskAndReportsThatItDoesNotFit) {
  SegmentResult result = Filled(0, 0, 40, 30);
  EXPECT_NEAR(CutToBox({10, 10, 10, 10}, result), 100.0 / 1200, 1e-12);
  EXPECT_EQ(result.area, 20 * 20);
  EXPECT_EQ(result.box[0], 5);
  EXPECT_EQ(result.box[2], 20);
}

TEST(CutToBox, CountsOnlyThePartOfTheBoxInTheView) {
  SegmentResult result = Filled(30, 0, 40, 30);
  EXPECT_NEAR(CutToBox({30, -1000, 1000, 5000}, result), 1, 1e-12);
  EXPECT_EQ(result.area, 300);
}

TEST(CutToBox, LeavesAnEmptyMaskEmpty) {
  SegmentResult result = Filled(0, 0, 0, 0);
  EXPECT_EQ(CutToBox({10, 10, 10, 10}, result), 0);
  EXPECT_EQ(result.area, 0);
}

}  // namespace
}  // namespace pepeseg
