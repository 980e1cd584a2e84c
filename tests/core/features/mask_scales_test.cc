#include "core/features/mask_scales.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace pepeseg {
namespace {

constexpr int kWidth = 40, kHeight = 30;

// A wall at distance 2, seen with a focal length of 20: a pixel is 0.1 wide.
View WallView(const std::vector<BinaryMask>& masks) {
  View view;
  view.camera = {kWidth, kHeight, 20, 20, 17, 14};
  view.masks = BuildMaskSet(kWidth, kHeight, masks);
  return view;
}

BinaryMask Rectangle(int x0, int y0, int x1, int y1) {
  BinaryMask mask;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      mask.pixels.push_back(x >= x0 && x < x1 && y >= y0 && y < y1);
    }
  }
  return mask;
}

const std::vector<float> kWall(kWidth* kHeight, 2.0f);

TEST(MaskScales, AreTwiceTheSpreadInSpace) {
  // The majority filter takes the corners off.
  const View view = WallView({Rectangle(3, 4, 23, 14)});
  double xx = 0, yy = 0, count = 0;
  for (int y = 4; y < 14; ++y) {
    for (int x = 3; x < 23; ++x) {
      if ((x == 3 || x == 22) && (y == 4 || y == 13)) continue;
      xx += std::pow((x - 12.5) * 0.1, 2);
      yy += std::pow((y - 8.5) * 0.1, 2);
      ++count;
    }
  }
  EXPECT_NEAR(MaskScales(view, kWall)[0], 2 * std::sqrt((xx + yy) / count), 1e-5);
}

TEST(MaskScales, GrowWithTheDistance) {
  const View view = WallView({Rectangle(3, 4, 23, 14)});
  const std::vector<float> far(kWidth * kHeight, 6.0f);
  EXPECT_NEAR(MaskScales(view, far)[0], 3 * MaskScales(view, kWall)[0], 1e-4);
}

TEST(MaskScales, AreMissingUnderEightPixels) {
  const View view = WallView({Rectangle(3, 4, 6, 7), Rectangle(20, 4, 24, 8)});
  const std::vector<float> scales = MaskScales(view, kWall);
  EXPECT_EQ(scales[0], kNoScale);  // 9 pixels less 4 corners
  EXPECT_GT(scales[1], 0);         // 16 less 4
}

TEST(MaskScales, LeaveThinLinesOut) {
  const View view = WallView({Rectangle(3, 4, 33, 5)});
  EXPECT_EQ(MaskScales(view, kWall)[0], kNoScale);
}

TEST(MaskScales, LeaveOutWhatHasNoDepthOrIsIgnored) {
  View view = WallView({Rectangle(3, 4, 23, 14)});
  std::vector<float> half = kWall;
  view.ignore.assign(half.size(), 0);
  for (size_t i = 0; i < half.size(); ++i) {
    if (i % kWidth >= 13) half[i] = 0;
  }
  const float narrow = MaskScales(view, half)[0];
  EXPECT_LT(narrow, MaskScales(view, kWall)[0]);
  for (size_t i = 0; i < half.size(); ++i) view.ignore[i] = i % kWidth >= 13 ? 255 : 0;
  EXPECT_EQ(MaskScales(view, kWall)[0], narrow);
  EXPECT_EQ(MaskScales(view, std::vector<float>(half.size()))[0], kNoScale);
}

TEST(ScaleQuantiles, RunFromTheSmallestToTheLargest) {
  const std::vector<float> knots = ScaleQuantiles({4, 0, 1, 2});
  ASSERT_EQ(knots.size(), 1000u);
  EXPECT_EQ(knots.front(), 1);
  EXPECT_EQ(knots.back(), 4);
  EXPECT_TRUE(std::is_sorted(knots.begin(), knots.end()));
  EXPECT_NEAR(knots[250], 1 + 2 * 250 / 999.0, 1e-5);
  EXPECT_TRUE(ScaleQuantiles({0, 0}).empty());
}

TEST(EvenScales, RunEvenlyFromTheSmallestToTheNinetyNinthPercentile) {
  std::vector<float> scales = {0, 1000};
  for (int i = 1; i <= 200; ++i) scales.push_back(static_cast<float>(i));
  const std::vector<float> knots = EvenScales(scales);
  ASSERT_EQ(knots.size(), 1000u);
  EXPECT_EQ(knots.front(), 1);
  EXPECT_EQ(knots.back(), 199);  // at 0.99 * 200 of the sorted ones
  EXPECT_NEAR(knots[333], 1 + 198 / 3.0, 1e-4);
  EXPECT_TRUE(EvenScales({0}).empty());
}

}  // namespace
}  // namespace pepeseg
