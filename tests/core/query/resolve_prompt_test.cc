#include "core/query/resolve_prompt.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/base/status_macros.h"
#include "core/evaluate/mask_scores.h"
#include "core/query/click_follower.h"
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
  ClickFollower follower(*segmenter_, nullptr, view_, {});
  ASSERT_OK(follower.Follow(kLeftPoint, {}, [] { return absl::OkStatus(); }));
  ASSERT_OK_AND_ASSIGN(const Query query, ResolvePrompt(*segmenter_, {view_, kLeftPoint}, {}));
  for (const int max_count : {1, 5}) {
    const Candidates found = follower.Found(max_count);
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

}  // namespace
}  // namespace pepeseg
