#include "core/evaluate/prompt_queries.h"

#include <gtest/gtest.h>

#include "tests/core/evaluate/two_blobs.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using testing::kTwoBlobsSize;

using PromptQueriesTest = testing::TwoBlobsTest;

// The reference view has no mask of the entity; one other view has.
TEST_F(PromptQueriesTest, FindsTheEntityByEachKindOfPrompt) {
  Show(1, "left", Left(1));
  Mask strip(size_t{kTwoBlobsSize} * kTwoBlobsSize), other(strip.size());
  for (int x = 28; x < 37; ++x)
    strip[48 * kTwoBlobsSize + x] = other[48 * kTwoBlobsSize + x + 32] = 1;
  strip[0] = 1;  // a pixel on nothing, which is left out
  const std::vector<PointPrompt> points = {{32.5, 48.5, true}, {64.5, 48.5, false}};
  const std::vector<PointPrompt> positive = {{30.5, 47.5, true}, {34.5, 50.5, true}, {1, 1, true}};
  struct Case {
    const char* name;
    PromptShape shape;
    bool knows_reference;
  };
  const Case cases[] = {{"mask", BinaryMask{Left(0)}, true},
                        {"points", points, false},
                        {"mean", PointMean{positive}, false},
                        {"scribbles", Scribbles{{strip}, {other}}, true},
                        {"positive scribbles", Scribbles{{strip}, {}}, false},
                        {"box", BoxPrompt{25, 41, 15, 15}, false}};
  for (const Case& c : cases) {
    SCOPED_TRACE(c.name);
    prompts_ = {{"left", "a", c.shape}};
    ASSERT_OK_AND_ASSIGN(const EvaluationResult result, Run());
    const EntityScores& score = result.entities[0];
    EXPECT_FALSE(score.missing);
    EXPECT_FALSE(score.click);
    EXPECT_GT(score.paper.mean.iou, 0.95);
    EXPECT_GT(score.automatic.mean.iou, 0.95);
    ASSERT_EQ(score.reference_choice.has_value(), c.knows_reference);
    EXPECT_EQ(result.scene.reference_choice.has_value(), c.knows_reference);
    if (c.knows_reference) {
      EXPECT_GT(score.reference_choice->mean.iou, 0.95);
    }
  }
  // The mask of the label itself, in a reference that is not the first view.
  Show(0, "left", Left(0));
  prompts_ = {{"left", "b", OwnMask{}}};
  ASSERT_OK_AND_ASSIGN(const EvaluationResult result, Run());
  EXPECT_EQ(result.entities[0].reference, "b");
  EXPECT_EQ(result.entities[0].scored, std::vector<std::string>{"a"});
  EXPECT_DOUBLE_EQ(result.entities[0].reference_choice->mean.iou, 1);
}

// A negative point keeps the right blob out at scales at which both have nearly the same feature.
TEST_F(PromptQueriesTest, LeavesOutWhatNegativePointsClaim) {
  for (int v = 0; v < 2; ++v) Show(v, "left", Left(v));
  options_.scales = {0.6};
  prompts_ = {{"left", "a", std::vector<PointPrompt>{{32.5, 48.5, true}}}};
  ASSERT_OK_AND_ASSIGN(EvaluationResult result, Run());
  EXPECT_NEAR(result.entities[0].iou_by_scale[0], 0.5, 0.02);
  prompts_ = {{"left", "a", std::vector<PointPrompt>{{32.5, 48.5, true}, {64.5, 48.5, false}}}};
  ASSERT_OK_AND_ASSIGN(result, Run());
  EXPECT_DOUBLE_EQ(result.entities[0].iou_by_scale[0], 1);
}

// The gated features of the blobs are (0.5, p) and (0.5, -p), with p from 1 at small scales to 0 at
// large ones; their mean is the first axis, whose cosine with both is half the angle's.
TEST_F(PromptQueriesTest, MatchesTheMeanFeatureOfTheReferenceMask) {
  options_.protocol = Protocol::kPromptable;
  options_.scales = {0.1, 0.6, 0.7};
  for (int v = 0; v < 3; ++v) {
    Show(v, "left", Left(v));
    Show(v, "pair", Pair(v));
  }
  ASSERT_OK_AND_ASSIGN(const EvaluationResult result, Run());
  const std::vector<double>& left = result.entities[0].iou_by_scale;
  EXPECT_GT(left[0], 0.95);
  EXPECT_GT(left[1], 0.95);         // the other blob has 0.89
  EXPECT_NEAR(left[2], 0.5, 0.02);  // 0.999
  const std::vector<double>& pair = result.entities[1].iou_by_scale;
  EXPECT_EQ(pair[0], 0);     // 0.45
  EXPECT_GT(pair[1], 0.95);  // 0.97
  EXPECT_GT(pair[2], 0.95);
  EXPECT_EQ(result.entities[1].paper.threshold, 0.9);
  EXPECT_EQ(result.entities[1].reference_choice->scale, 0.6);
  EXPECT_GT(result.entities[0].automatic.mean.iou, 0.95);

  prompts_ = {{"left", "a", BoxPrompt{25, 41, 15, 15}}};
  EXPECT_STATUS(Run(), absl::StatusCode::kInvalidArgument,
                "entity \"left\", reference view \"a\": the protocol needs a mask or scribbles");
}

TEST_F(PromptQueriesTest, MatchesTheMeanOfPointsAndOfPositiveScribbles) {
  options_.protocol = Protocol::kPromptable;
  options_.scales = {0.1, 0.6};
  Show(1, "pair", Pair(1));
  const std::vector<PointPrompt> points = {{32.5, 48.5, true}, {64.5, 48.5, true}};
  Mask stroke(size_t{kTwoBlobsSize} * kTwoBlobsSize);
  for (const PointPrompt& point : points)
    stroke[48 * kTwoBlobsSize + static_cast<size_t>(point.x)] = 1;
  for (const PromptShape& shape : {PromptShape(points), PromptShape(PointMean{points}),
                                   PromptShape(Scribbles{{stroke}, {}})}) {
    prompts_ = {{"pair", "a", shape}};
    ASSERT_OK_AND_ASSIGN(const EvaluationResult result, Run());
    EXPECT_EQ(result.entities[0].iou_by_scale[0], 0);
    EXPECT_GT(result.entities[0].iou_by_scale[1], 0.95);
  }
}

}  // namespace
}  // namespace pepeseg
