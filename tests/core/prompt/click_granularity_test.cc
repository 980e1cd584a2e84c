#include "core/prompt/click_granularity.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/testing/front_blobs.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

constexpr int kWidth = 40, kHeight = 30;
using Mask = std::vector<uint8_t>;

// A rectangle of pixels, half open.
struct Rectangle {
  int left, top, right, bottom;
};
Mask MaskOf(const std::vector<Rectangle>& rectangles) {
  Mask mask(kWidth * kHeight);
  for (const Rectangle& r : rectangles) {
    for (int y = r.top; y < r.bottom; ++y) {
      std::fill(mask.begin() + y * kWidth + r.left, mask.begin() + y * kWidth + r.right, 1);
    }
  }
  return mask;
}
double Plausibility(const Click& click, const Mask& before, const Mask& after) {
  return ClickPlausibility(click, before, after, kWidth);
}

const Rectangle kCup = {10, 10, 20, 20}, kHandle = {20, 12, 25, 17}, kWall = {0, 0, 40, 9};
constexpr PixelIndex kOnHandle = {22, 14}, kOnWallsEdge = {15, 8};

TEST(ClickPlausibility, IsOneInTheMiddleOfWhatIsAdded) {
  EXPECT_EQ(Plausibility({kOnHandle, true}, MaskOf({kCup}), MaskOf({kCup, kHandle})), 1);
}

TEST(ClickPlausibility, FallsTowardsTheEdgeOfWhatIsAdded) {
  // One pixel deep in what is five deep.
  EXPECT_NEAR(Plausibility({kOnWallsEdge, true}, MaskOf({kCup}), MaskOf({kCup, kWall})), 0.2, 1e-9);
}

TEST(ClickPlausibility, IsOneInTheMiddleOfWhatIsRemoved) {
  EXPECT_EQ(Plausibility({kOnHandle, false}, MaskOf({kCup, kHandle}), MaskOf({kCup})), 1);
}

TEST(ClickPlausibility, FallsWithWhatAPositiveClickLoses) {
  const Rectangle half_cup = {10, 10, 15, 20};
  EXPECT_NEAR(Plausibility({kOnHandle, true}, MaskOf({kCup}), MaskOf({half_cup, kHandle})), 0.5,
              1e-9);
}

TEST(ClickPlausibility, FallsWithWhatANegativeClickAdds) {
  const Rectangle beside = {30, 20, 40, 30};
  EXPECT_NEAR(Plausibility({kOnHandle, false}, MaskOf({kCup, kHandle}), MaskOf({kCup, beside})),
              0.5, 1e-9);
}

TEST(ClickPlausibility, OfAnAnsweredClickIsTheIouOfTheMasks) {
  EXPECT_EQ(Plausibility({{15, 15}, true}, MaskOf({kCup}), MaskOf({kCup})), 1);
  EXPECT_NEAR(Plausibility({{15, 15}, true}, MaskOf({kCup}), MaskOf({kCup, kHandle})), 0.8, 1e-9);
  EXPECT_EQ(Plausibility({kOnHandle, false}, MaskOf({kCup}), MaskOf({kCup})), 1);
}

TEST(ClickPlausibility, IsZeroWhereThePixelDoesNotChangeOrNothingIsLeft) {
  EXPECT_EQ(Plausibility({kOnHandle, true}, MaskOf({kCup}), MaskOf({kCup, kWall})), 0);
  EXPECT_EQ(Plausibility({kOnHandle, false}, MaskOf({kCup, kHandle}), MaskOf({})), 0);
}

TEST(ClickPlausibility, CountsTheImagesBorderAsAnEdge) {
  const Rectangle strip = {0, 0, 40, 4};
  EXPECT_NEAR(Plausibility({{20, 0}, true}, MaskOf({kCup}), MaskOf({kCup, strip})), 0.5, 1e-9);
}

constexpr int kSize = 48;
constexpr double kLeftX = 17.5, kRightX = 30.5, kY = 24.5;

class ClickGranularityTest : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_OK_AND_ASSIGN(segmenter_, Segmenter::Create(*backend_, testing::PairOfBlobs(kSize)));
    view_ = segmenter_->model().views[0];
  }
  // What the best rung shows: the left blob, the right one.
  std::pair<bool, bool> Shown(const std::vector<PointPrompt>& points) const {
    const auto clicks = FindClickedFeatures(*segmenter_, view_, points);
    EXPECT_OK(clicks);
    const auto ladder = FindGranularities(*segmenter_, *clicks, GridOf({}), 5);
    EXPECT_OK(ladder);
    const StableGranularity& best = ladder->rungs[ladder->best];
    const Query query = {clicks->query.features, clicks->query.positive, best.scale,
                         best.threshold};
    const auto results = segmenter_->Segment(query, {&view_, 1});
    EXPECT_OK(results);
    const auto at = [&](double x) {
      return (*results)[0].mask.pixels[static_cast<size_t>(kY) * kSize + static_cast<size_t>(x)];
    };
    return {at(kLeftX) != 0, at(kRightX) != 0};
  }

  std::unique_ptr<Backend> backend_ = MakeCpuBackend(2);
  std::unique_ptr<Segmenter> segmenter_;
  ModelView view_;
};

TEST_F(ClickGranularityTest, AnswersAllPoints) {
  const PointPrompt left = {kLeftX, kY, true}, right = {kRightX, kY, true};
  const PointPrompt not_left = {kLeftX, kY, false}, not_right = {kRightX, kY, false};
  EXPECT_EQ(Shown({left, right}), std::pair(true, true));
  EXPECT_EQ(Shown({left, not_right}), std::pair(true, false));
  EXPECT_EQ(Shown({right, not_left}), std::pair(false, true));
}

TEST_F(ClickGranularityTest, KeepsTheMaskThatAnswersThePointAlready) {
  const PointPrompt left = {kLeftX, kY, true}, next_to_it = {kLeftX + 1, kY, true};
  EXPECT_EQ(Shown({left, next_to_it}), Shown({left}));
}

TEST_F(ClickGranularityTest, AnswersMorePointsThanItCorrectsOneByOne) {
  std::vector<PointPrompt> points(30, {kLeftX, kY, true});
  points.push_back({kRightX, kY, false});
  EXPECT_EQ(Shown(points), std::pair(true, false));
  std::rotate(points.begin(), points.end() - 1, points.end());
  EXPECT_EQ(Shown(points), std::pair(true, false));
}

TEST_F(ClickGranularityTest, TakesTheFirstPositivePointFirst) {
  const PointPrompt right = {kRightX, kY, true}, not_left = {kLeftX, kY, false};
  EXPECT_EQ(Shown({not_left, right}), std::pair(false, true));
}

}  // namespace
}  // namespace pepeseg
