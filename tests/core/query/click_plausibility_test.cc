#include "core/query/click_plausibility.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace pepeseg {
namespace {

class ClickPlausibilityTest : public ::testing::Test {
 protected:
  static constexpr int kWidth = 40, kHeight = 30;
  using Mask = std::vector<uint8_t>;
  // A rectangle of pixels, half open.
  struct Rectangle {
    int left, top, right, bottom;
  };
  static Mask MaskOf(const std::vector<Rectangle>& rectangles) {
    Mask mask(kWidth * kHeight);
    for (const Rectangle& r : rectangles) {
      for (int y = r.top; y < r.bottom; ++y) {
        std::fill(mask.begin() + y * kWidth + r.left, mask.begin() + y * kWidth + r.right, 1);
      }
    }
    return mask;
  }
  static double Plausibility(const PixelClick& click, const Mask& before, const Mask& after) {
    return ClickPlausibility({&click, 1}, before, after, kWidth);
  }
  static double First(int x, int y, const Mask& mask) {
    return FirstClickPlausibility({x, y}, mask, kWidth);
  }

  static constexpr Rectangle kCup = {10, 10, 20, 20}, kHandle = {20, 12, 25, 17};
  static constexpr Rectangle kWall = {0, 0, 40, 9};
  static constexpr PixelIndex kOnHandle = {22, 14}, kOnWallsEdge = {15, 8};
};

TEST_F(ClickPlausibilityTest, OfAFirstClickFallsFromTheMiddleToTheEdge) {
  EXPECT_EQ(First(22, 14, MaskOf({kHandle})), 1);
  EXPECT_NEAR(First(20, 14, MaskOf({kHandle})), std::pow(1 / 3.0, 1.5), 1e-9);
  EXPECT_EQ(First(5, 5, MaskOf({kHandle})), 0);
  // A click in the middle of the handle is at the edge of the whole.
  EXPECT_LT(First(22, 14, MaskOf({kCup, kHandle})), First(22, 14, MaskOf({kHandle})));
}

TEST_F(ClickPlausibilityTest, IsOneInTheMiddleOfWhatIsAdded) {
  EXPECT_NEAR(Plausibility({kOnHandle, true}, MaskOf({kCup}), MaskOf({kCup, kHandle})), 1, 1e-9);
}

TEST_F(ClickPlausibilityTest, FallsTowardsTheEdgeOfWhatIsAdded) {
  // One pixel deep in what is five deep.
  EXPECT_NEAR(Plausibility({kOnWallsEdge, true}, MaskOf({kCup}), MaskOf({kCup, kWall})), 0.2, 1e-9);
}

TEST_F(ClickPlausibilityTest, IsOneInTheMiddleOfWhatIsRemoved) {
  EXPECT_NEAR(Plausibility({kOnHandle, false}, MaskOf({kCup, kHandle}), MaskOf({kCup})), 1, 1e-9);
}

// Half of the cup, 50 pixels, is lost, and 25 pixels are added.
TEST_F(ClickPlausibilityTest, FallsWithWhatAPositiveClickLoses) {
  const Rectangle half_cup = {10, 10, 15, 20};
  EXPECT_NEAR(Plausibility({kOnHandle, true}, MaskOf({kCup}), MaskOf({half_cup, kHandle})),
              std::cbrt(0.5 * 25 / 75), 1e-9);
}

// 25 pixels go and 100 come, of an answer of 200.
TEST_F(ClickPlausibilityTest, FallsWithWhatANegativeClickAdds) {
  const Rectangle next_to = {30, 20, 40, 30};
  EXPECT_NEAR(Plausibility({kOnHandle, false}, MaskOf({kCup, kHandle}), MaskOf({kCup, next_to})),
              std::cbrt(0.5 * 25 / 125), 1e-9);
}

TEST_F(ClickPlausibilityTest, FallsWithEachClickThatIsNotAnswered) {
  const std::vector<PixelClick> clicks = {{{35, 25}, true}, {kOnHandle, true}};
  EXPECT_NEAR(ClickPlausibility(clicks, MaskOf({kCup}), MaskOf({kCup, kHandle}), kWidth), 0.7,
              1e-9);
}

TEST_F(ClickPlausibilityTest, IsZeroWhereThePixelDoesNotChangeAsAsked) {
  EXPECT_EQ(Plausibility({kOnHandle, true}, MaskOf({kCup}), MaskOf({kCup, kWall})), 0);
  EXPECT_EQ(Plausibility({{15, 15}, true}, MaskOf({kCup}), MaskOf({kCup, kHandle})), 0);
  EXPECT_EQ(Plausibility({{15, 15}, true}, MaskOf({kCup}), MaskOf({})), 0);
}

TEST_F(ClickPlausibilityTest, CountsTheImagesBorderAsAnEdge) {
  const Rectangle strip = {0, 0, 40, 4};
  EXPECT_NEAR(Plausibility({{20, 0}, true}, MaskOf({kCup}), MaskOf({kCup, strip})), 0.5, 1e-9);
}

TEST_F(ClickPlausibilityTest, ChangesOnlyWhatIsConnectedWithTheClick) {
  const Rectangle half_cup = {10, 10, 15, 20};
  const Mask before = MaskOf({kCup}), after = MaskOf({half_cup, kHandle, kWall});
  const auto connected = [&](const PixelClick& click) {
    return ChangeMask(click, before, after, kWidth, ChangeReach::kConnected);
  };
  EXPECT_EQ(connected({kOnHandle, true}), MaskOf({kCup, kHandle}));
  EXPECT_EQ(connected({{17, 15}, false}), MaskOf({half_cup}));
  EXPECT_TRUE(connected({{35, 25}, true}).empty());
  EXPECT_EQ(ChangeMask({kOnHandle, true}, before, after, kWidth, ChangeReach::kWhole), after);
}

// The click is two pixels deep in the wall, which is nine high: pixels up to three away change.
TEST_F(ClickPlausibilityTest, ChangesOnlyWhatIsNearTheClick) {
  const Mask before = MaskOf({kCup});
  const Mask near =
      ChangeMask({{15, 7}, true}, before, MaskOf({kCup, kWall}), kWidth, ChangeReach::kNear);
  const auto at = [&](int x, int y) { return near[y * kWidth + x] != 0; };
  EXPECT_TRUE(at(15, 4) && at(12, 7) && at(18, 7));
  EXPECT_FALSE(at(15, 3) || at(11, 7) || at(19, 7));
  EXPECT_TRUE(at(15, 15));
}

TEST_F(ClickPlausibilityTest, CountsTheClicksThatAMaskAnswers) {
  const std::vector<PixelClick> clicks = {{{15, 15}, true}, {{0, 0}, true}, {{1, 1}, false}};
  EXPECT_EQ(NumAnswered(clicks, MaskOf({kCup}), kWidth), 2);
}

}  // namespace
}  // namespace pepeseg
