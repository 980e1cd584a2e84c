#include "core/evaluate/label_propagation.h"

#include <gtest/gtest.h>

#include "tests/core/evaluate/two_blobs.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using LabelPropagationTest = testing::TwoBlobsTest;

// Cosine of the blobs: 0 at scale 0.5, 0.89 at 0.6, 0.999 at 0.7.
TEST_F(LabelPropagationTest, PropagatesTheClustersThatTheReferenceMaskSelects) {
  options_.protocol = Protocol::kLabelPropagation;
  options_.scales = {0.1, 0.5, 0.6, 0.7};
  for (int v = 0; v < 3; ++v) {
    Show(v, "left", Left(v));
    Show(v, "pair", Pair(v));
  }
  ASSERT_OK_AND_ASSIGN(EvaluationResult result, Run());
  ASSERT_EQ(result.entities.size(), 2u);
  const EntityScores& left = result.entities[0];
  ASSERT_EQ(left.iou_by_scale.size(), 4u);
  EXPECT_GT(left.iou_by_scale[0], 0.95);
  EXPECT_GT(left.iou_by_scale[1], 0.95);
  EXPECT_NEAR(left.iou_by_scale[2], 0.5, 0.02);  // the other blob is over 0.7
  EXPECT_NEAR(left.iou_by_scale[3], 0.5, 0.02);
  EXPECT_GT(left.automatic.mean.iou, 0.95);
  EXPECT_EQ(left.reference_choice->threshold, 0.7);
  EXPECT_EQ(left.reference_choice->scale, 0.1);
  for (const double iou : result.entities[1].iou_by_scale) EXPECT_GT(iou, 0.95);

  options_.label_propagation.min_cosine = 0.95;
  ASSERT_OK_AND_ASSIGN(result, Run());
  EXPECT_GT(result.entities[0].iou_by_scale[2], 0.95);
  EXPECT_NEAR(result.entities[0].iou_by_scale[3], 0.5, 0.02);
}

TEST_F(LabelPropagationTest, RefusesToPropagateAPromptWithoutAMask) {
  options_.protocol = Protocol::kLabelPropagation;
  for (int v = 0; v < 2; ++v) Show(v, "left", Left(v));
  prompts_ = {{"left", "a", std::vector<PointPrompt>{{32.5, 48.5, true}}}};
  EXPECT_STATUS(
      Run(), absl::StatusCode::kInvalidArgument,
      "entity \"left\", reference view \"a\": the protocol needs a mask or scribbles; the "
      "prompt is points or a box");
}

TEST(SelectClusters, TakesThoseMostlyInsideAndThoseThatCoverTheMask) {
  // Cluster 0: 5 points, 4 inside (80 %). Cluster 1: 12 points, 2 inside (10 % of the mask).
  // Cluster 2: 3 points, 1 inside. Noise: 13 inside.
  Clusters clusters = {.count = 3, .labels = {}, .strengths = {}};
  std::vector<uint8_t> inside;
  const auto add = [&](int label, int num_inside, int num_outside) {
    for (int i = 0; i < num_inside + num_outside; ++i) {
      clusters.labels.push_back(label);
      inside.push_back(i < num_inside ? 1 : 0);
    }
  };
  add(1, 2, 10);
  add(0, 4, 1);
  add(2, 1, 2);
  add(kNoise, 13, 50);
  EXPECT_EQ(SelectClusters(clusters, inside, {}), (std::vector<int>{0, 1}));
  EXPECT_EQ(SelectClusters(clusters, inside, {.min_inside = 0.81, .min_covered = 0.2}),
            std::vector<int>{0});  // covers exactly 20 %
  EXPECT_TRUE(SelectClusters(clusters, inside, {.min_inside = 0.81, .min_covered = 0.21}).empty());
}

}  // namespace
}  // namespace pepeseg
