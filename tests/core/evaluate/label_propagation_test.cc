#include "core/evaluate/label_propagation.h"

#include <gtest/gtest.h>

#include "tests/core/evaluate/two_blobs.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using LabelPropagationTest = testing::TwoBlobsTest;

constexpr Protocol kBothForms[] = {Protocol::kLabelPropagation, Protocol::kLabelPropagationPixels};

// Cosine of the blobs: 0 at scale 0.5, 0.89 at 0.6, 0.999 at 0.7.
TEST_F(LabelPropagationTest, PropagatesTheClustersThatTheReferenceMaskSelects) {
  options_.scales = {0.1, 0.5, 0.6, 0.7};
  for (int v = 0; v < 3; ++v) {
    Show(v, "left", Left(v));
    Show(v, "pair", Pair(v));
  }
  for (const Protocol protocol : kBothForms) {
    SCOPED_TRACE(static_cast<int>(protocol));
    options_.protocol = protocol;
    options_.label_propagation.min_cosine = 0.7;
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
}

TEST_F(LabelPropagationTest, RefusesToPropagateAPromptWithoutAMask) {
  for (int v = 0; v < 2; ++v) Show(v, "left", Left(v));
  prompts_ = {{"left", "a", std::vector<PointPrompt>{{32.5, 48.5, true}}}};
  for (const Protocol protocol : kBothForms) {
    options_.protocol = protocol;
    EXPECT_STATUS(
        Run(), absl::StatusCode::kInvalidArgument,
        "entity \"left\", reference view \"a\": the protocol needs a mask or scribbles; the "
        "prompt is points or a box");
  }
}

// The blobs are so close that they blend. Pixels in between are far from both centroids and are in
// few pixels' company, so the clusters are those of the blobs, and each such pixel is in the
// nearer.
TEST_F(LabelPropagationTest, TakesWholeClustersThatCorrespondAndNotThePixelsOverTheCosine) {
  Model close = testing::TwoBlobs();
  close.gaussians.Plane(kMeanPlane)[0] = -0.31f;
  close.gaussians.Plane(kMeanPlane)[1] = 0.31f;
  const std::vector<float> features = close.field.features;
  ASSERT_OK_AND_ASSIGN(segmenter_, Segmenter::Create(*backend_, std::move(close)));
  const Query nearer = {features, {1, 0}, 0.1, 0};
  for (int v = 0; v < 3; ++v) {
    const ModelView& view = segmenter_->model().views[v];
    ASSERT_OK_AND_ASSIGN(const auto left, segmenter_->Segment(nearer, {&view, 1}));
    Show(v, "left", left[0].mask.pixels);
  }
  options_.scales = {0.1};
  options_.label_propagation.min_cosine = 0.999;
  std::vector<double> ious;
  for (const Protocol protocol : kBothForms) {
    options_.protocol = protocol;
    ASSERT_OK_AND_ASSIGN(const EvaluationResult result, Run());
    ious.push_back(result.entities[0].iou_by_scale[0]);
  }
  EXPECT_GT(ious[0], 0.98) << "clusters";
  EXPECT_LT(ious[1], 0.95) << "pixels";
}

// The mask is that of the clusters even where borders are refined in other protocols.
TEST_F(LabelPropagationTest, RefinesNoBordersOfClusters) {
  options_.protocol = Protocol::kLabelPropagation;
  for (int v = 0; v < 3; ++v) Show(v, "left", Left(v));
  ASSERT_OK_AND_ASSIGN(const EvaluationResult plain, Run());
  options_.refine_borders = true;
  ASSERT_OK_AND_ASSIGN(const EvaluationResult refined, Run());
  EXPECT_EQ(plain.scene.paper.iou, refined.scene.paper.iou);
  EXPECT_EQ(plain.scene.paper.boundary_iou, refined.scene.paper.boundary_iou);
}

// Scoring goes through the views backwards when scales are chosen: the clusters of a view that was
// left must give the same mask again.
TEST_F(LabelPropagationTest, MakesTheSameMaskOfAViewAgain) {
  const EvaluationTask task = {.views = Request().views, .entities = {}, .left_out = {}};
  const auto go_on = [] { return absl::OkStatus(); };
  const std::vector<double> scales = {0.1};
  const QueryTask query_task = {*segmenter_, task, scales, go_on};
  const LabelPropagationOptions options;
  PropagatedMasks masks(query_task, options);
  const std::vector<float>& features = segmenter_->model().field.features;
  const Query left = {{features.begin(), features.begin() + kFeatureSize}, {1}, 0.1, 0};
  ASSERT_OK_AND_ASSIGN(const BinaryMask first, masks.In(0, left));
  ASSERT_OK_AND_ASSIGN(const BinaryMask other, masks.In(2, left));
  ASSERT_OK_AND_ASSIGN(const BinaryMask again, masks.In(0, left));
  EXPECT_EQ(first.pixels, again.pixels);
  EXPECT_NE(first.pixels, other.pixels);
  EXPECT_GT(Iou(first.pixels, Left(0)), 0.98);
  EXPECT_GT(Iou(other.pixels, Left(2)), 0.98);
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
