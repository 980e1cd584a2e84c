#include "core/query/resolve_prompt.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/base/status_macros.h"
#include "core/evaluate/mask_scores.h"
#include "core/query/frame.h"
#include "tests/testing/front_blobs.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using absl::StatusCode::kInvalidArgument;

constexpr int kSize = 48;
constexpr double kLeftX = 17.5, kRightX = 30.5, kY = 24.5;
const std::vector<PointPrompt> kLeftPoint = {{kLeftX, kY, true}};

class ResolvePromptTest : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_OK_AND_ASSIGN(segmenter_, Segmenter::Create(*backend_, testing::PairOfBlobs(kSize)));
    view_ = segmenter_->model().views[0];
  }
  absl::StatusOr<std::vector<uint8_t>> Mask(const decltype(Prompt::what)& what,
                                            const Granularity& granularity = {}) const {
    ASSIGN_OR_RETURN(const Query query, ResolvePrompt(*segmenter_, {view_, what}, granularity));
    ASSIGN_OR_RETURN(const auto results, segmenter_->Segment(query, {&view_, 1}));
    return results[0].mask.pixels;
  }
  // Returns the mask of a click at a scale.
  std::vector<uint8_t> Clicked(double scale) const {
    const auto mask = Mask(kLeftPoint, {scale, 0.75});
    EXPECT_OK(mask);
    return mask.value_or(std::vector<uint8_t>());
  }
  static bool Shows(const std::vector<uint8_t>& mask, double x) {
    return mask[static_cast<size_t>(kY) * kSize + static_cast<size_t>(x)] != 0;
  }

  std::unique_ptr<Backend> backend_ = MakeCpuBackend(2);
  std::unique_ptr<Segmenter> segmenter_;
  ModelView view_;
};

TEST_F(ResolvePromptTest, KeepsTheGivenGranularityOfPoints) {
  ASSERT_OK_AND_ASSIGN(const Query query,
                       ResolvePrompt(*segmenter_, {view_, kLeftPoint}, {0.37, 0.61}));
  EXPECT_EQ(query.scale, 0.37);
  EXPECT_EQ(query.threshold, 0.61);
  EXPECT_EQ(query.positive, std::vector<uint8_t>{1});
}

TEST_F(ResolvePromptTest, TakesTheBestProposalForPointsWithoutAGranularity) {
  ASSERT_OK_AND_ASSIGN(const ClickedFeatures clicks,
                       FindClickedFeatures(*segmenter_, view_, kLeftPoint));
  ASSERT_OK_AND_ASSIGN(const Query query, ResolvePrompt(*segmenter_, {view_, kLeftPoint}, {}));
  for (const int max_count : {1, 5}) {
    ASSERT_OK_AND_ASSIGN(const Candidates found,
                         FindGranularities(*segmenter_, clicks, GridOf({}), max_count));
    ASSERT_FALSE(found.list.empty());
    EXPECT_EQ(query.scale, found.list[found.best].scale);
    EXPECT_EQ(query.threshold, found.list[found.best].threshold);
  }
}

TEST_F(ResolvePromptTest, ChoosesTheThresholdOfAScaleAndTheScaleOfAThreshold) {
  ASSERT_OK_AND_ASSIGN(const auto small, Mask(kLeftPoint, {.scale = 0.0}));
  EXPECT_TRUE(Shows(small, kLeftX) && !Shows(small, kRightX));
  ASSERT_OK_AND_ASSIGN(const auto large, Mask(kLeftPoint, {.scale = 1.0}));
  EXPECT_TRUE(Shows(large, kLeftX) && Shows(large, kRightX));
  ASSERT_OK_AND_ASSIGN(const Query query,
                       ResolvePrompt(*segmenter_, {view_, kLeftPoint}, {.threshold = 0.9}));
  EXPECT_EQ(query.threshold, 0.9);
}

// Returns a line between two positions of a view of kSize x kSize pixels.
BinaryMask Line(const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
  ModelView view;
  view.camera = {kSize, kSize};
  const Stroke stroke = {{from, to}};
  return Frame(view).Draw({&stroke, 1})->positive;
}

TEST_F(ResolvePromptTest, FindsWhatALineIsOn) {
  const BinaryMask on_left = Line({kLeftX - 2, kY}, {kLeftX + 2, kY});
  const BinaryMask on_right = Line({kRightX - 2, kY}, {kRightX + 2, kY});
  ASSERT_OK_AND_ASSIGN(const auto left, Mask(Scribbles{on_left, {}}));
  EXPECT_EQ(left, *Mask(kLeftPoint));
  ASSERT_OK_AND_ASSIGN(const auto both, Mask(Scribbles{Line({kLeftX, kY}, {kRightX, kY}), {}}));
  EXPECT_TRUE(Shows(both, kLeftX) && Shows(both, kRightX));
  ASSERT_OK_AND_ASSIGN(const auto without, Mask(Scribbles{on_left, on_right}, {1.0, 0.75}));
  EXPECT_TRUE(Shows(without, kLeftX) && !Shows(without, kRightX));
  EXPECT_TRUE(IsNothingThere(Mask(Scribbles{Line({1, 1}, {3, 1}), {}}).status()));
}

TEST_F(ResolvePromptTest, AsksForTheMeanOfPoints) {
  const PointsPrompt points = {{kLeftX, kY, true}, {kRightX, kY, true}, {1, 1, true}};
  ASSERT_OK_AND_ASSIGN(const Query query,
                       ResolvePrompt(*segmenter_, {view_, PointMean{points}}, {0.5, 0.75}));
  EXPECT_EQ(query.positive, std::vector<uint8_t>{1});
  ASSERT_OK_AND_ASSIGN(const std::vector<float> features,
                       SolidFeatures(*segmenter_, view_, PixelsOf(points, kSize)));
  EXPECT_EQ(features.size(), 2u * kFeatureSize);  // nothing is under the last point
  EXPECT_EQ(query.features, GatedMean(features, segmenter_->model().field.gate, 0.5f));
  EXPECT_TRUE(IsNothingThere(Mask(PointMean{{{1, 1, true}}}).status()));
}

TEST_F(ResolvePromptTest, FindsAMaskAtTheScaleThatFits) {
  for (const double scale : {0.0, 1.0}) {
    const std::vector<uint8_t> want = Clicked(scale);
    ASSERT_OK_AND_ASSIGN(const auto got, Mask(BinaryMask{want}));
    EXPECT_GT(Iou(got, want), 0.9) << "at scale " << scale;
  }
}

TEST_F(ResolvePromptTest, FindsAMaskOfTwoThingsAtScalesThatSeparateThem) {
  const std::vector<uint8_t> both = Clicked(1.0);
  ASSERT_OK_AND_ASSIGN(const Query query,
                       ResolvePrompt(*segmenter_, {view_, BinaryMask{both}}, {0.0, 0.9}));
  EXPECT_EQ(query.positive.size(), 2u);  // their mean resembles neither of them
  ASSERT_OK_AND_ASSIGN(const auto got, Mask(BinaryMask{both}, {0.0, 0.9}));
  EXPECT_GT(Iou(got, both), 0.9);
}

TEST_F(ResolvePromptTest, FindsWhatFillsABox) {
  const BoxPrompt left = {10, 16, 13, 16}, all = {9, 15, 30, 18};
  ASSERT_OK_AND_ASSIGN(const auto one, Mask(left));
  EXPECT_TRUE(Shows(one, kLeftX) && !Shows(one, kRightX));
  ASSERT_OK_AND_ASSIGN(const auto both, Mask(all));
  EXPECT_TRUE(Shows(both, kLeftX) && Shows(both, kRightX));
  // A box is clipped at the edge of the image.
  ASSERT_OK_AND_ASSIGN(const auto cut, Mask(BoxPrompt{-100, -100, 123, 132}));
  EXPECT_TRUE(Shows(cut, kLeftX) && !Shows(cut, kRightX));
}

TEST_F(ResolvePromptTest, RendersNoViewTwice) {
  EXPECT_OK(Mask(kLeftPoint));
  EXPECT_OK(Mask(BinaryMask{Clicked(0)}));
  EXPECT_OK(Mask(BoxPrompt{10, 16, 13, 16}));
  EXPECT_EQ(segmenter_->num_renders(), 1);
}

TEST_F(ResolvePromptTest, RefusesInvalidBoxesAndMasks) {
  EXPECT_STATUS(Mask(BoxPrompt{NAN, 1, 5, 5}), kInvalidArgument, "box nan,1 5x5 is not finite");
  EXPECT_STATUS(Mask(BoxPrompt{1, 1, 0, 5}), kInvalidArgument, "is empty");
  EXPECT_STATUS(Mask(BoxPrompt{48, 1, 5, 5}), kInvalidArgument, "is outside view \"front\"");
  EXPECT_STATUS(Mask(BoxPrompt{1, 1, 2, 2}), kInvalidArgument, "nothing with a feature");
  EXPECT_STATUS(Mask(BinaryMask{}), kInvalidArgument, "the mask has 0 pixels");
  BinaryMask mask = {std::vector<uint8_t>(size_t{kSize} * kSize)};
  EXPECT_STATUS(Mask(mask), kInvalidArgument, "no pixel is in the mask");
  mask.pixels[0] = 1;
  EXPECT_STATUS(Mask(mask), kInvalidArgument, "nothing with a feature is rendered under the mask");
  EXPECT_STATUS(Mask(kLeftPoint, {.scale = 7}), kInvalidArgument, "scale_quantile is 7");
  EXPECT_STATUS(Mask(kLeftPoint, {.threshold = NAN}), kInvalidArgument, "threshold is nan");
}

TEST(SmallViewOf, KeepsSmallViewsAndShrinksLargeOnesByWholeFactors) {
  ModelView view;
  view.camera = {512, 512, 400, 400, 256, 256};
  EXPECT_EQ(SmallViewOf(view).factor, 1);
  view.camera = {1152, 868, 1000, 1010, 570, 430};
  const SmallView small = SmallViewOf(view);
  EXPECT_EQ(small.factor, 2);
  EXPECT_EQ(small.view.camera.width, 576);
  EXPECT_EQ(small.view.camera.height, 434);
  EXPECT_EQ(small.view.camera.fx, 500);
  EXPECT_EQ(small.view.camera.cy, 215);
}

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
double Plausibility(const PixelClick& click, const Mask& before, const Mask& after) {
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
  const Rectangle next_to = {30, 20, 40, 30};
  EXPECT_NEAR(Plausibility({kOnHandle, false}, MaskOf({kCup, kHandle}), MaskOf({kCup, next_to})),
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
    const Candidate& best = ladder->list[ladder->best];
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
