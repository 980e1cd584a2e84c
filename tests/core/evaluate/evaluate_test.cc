#include "core/evaluate/evaluate.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/evaluate/mask_scores.h"
#include "tests/core/evaluate/two_blobs.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using testing::kTwoBlobsSize;

absl::Status GoOn() { return absl::OkStatus(); }

using EvaluateTest = testing::TwoBlobsTest;

TEST_F(EvaluateTest, ScoresTheOtherViewsAtWhatTheReferenceChose) {
  const double area_b = Area(Left(1)), area_c = Area(Left(2));
  Show(0, "left", Left(0));
  Show(1, "left", Union(Left(1), BottomRows(1)));  // 96 pixels that no click finds
  Show(2, "left", Union(Left(2), BottomRows(2)));
  ASSERT_OK_AND_ASSIGN(const EvaluationResult result, Run());
  ASSERT_EQ(result.entities.size(), 1u);
  const EntityScores& score = result.entities[0];
  EXPECT_FALSE(score.missing);
  EXPECT_EQ(score.reference, "a");
  EXPECT_EQ(score.scored, (std::vector<std::string>{"b", "c"}));
  EXPECT_EQ(score.num_pixels[0], static_cast<int64_t>(area_b) + 96);
  ASSERT_TRUE(score.click);
  EXPECT_NEAR(score.click->x, 32.5, 1);
  EXPECT_NEAR(score.click->y, 48.5, 1);
  // Every scale up to 0.5 and every threshold finds the blob alone: their middle is taken, and a
  // step lower in the threshold.
  ASSERT_TRUE(score.reference_choice);
  const ChoiceScores& chosen = *score.reference_choice;
  EXPECT_EQ(chosen.scale, 0.3);
  EXPECT_EQ(chosen.threshold, 0.7);
  const double iou_b = area_b / (area_b + 96), iou_c = area_c / (area_c + 192);
  EXPECT_DOUBLE_EQ(chosen.views[0].iou, iou_b);
  EXPECT_DOUBLE_EQ(chosen.views[1].iou, iou_c);
  EXPECT_DOUBLE_EQ(chosen.mean.iou, (iou_b + iou_c) / 2);
  EXPECT_DOUBLE_EQ(result.scene.reference_choice->iou, chosen.mean.iou);
  double boundary = 0;
  for (const int v : {1, 2})
    boundary += BoundaryIou(Left(v), masks_[v]["left"], kTwoBlobsSize, kTwoBlobsSize) / 2;
  EXPECT_NEAR(chosen.mean.boundary_iou, boundary, 1e-12);
}

TEST_F(EvaluateTest, ChoosesTheScaleOnTheScoredViewsOnTheReferenceAndWithoutTruth) {
  Show(0, "thing", Left(0));
  Show(1, "thing", Pair(1));
  ASSERT_OK_AND_ASSIGN(const EvaluationResult result, Run());
  ASSERT_EQ(result.entities.size(), 1u);
  const EntityScores& score = result.entities[0];
  EXPECT_EQ(score.reference, "a");
  EXPECT_EQ(score.scored, std::vector<std::string>{"b"});
  EXPECT_EQ(score.num_pixels, std::vector<int64_t>{static_cast<int64_t>(Area(Pair(1)))});
  EXPECT_EQ(score.paper.scale, 0.6);  // the smallest at which the blobs are together
  EXPECT_DOUBLE_EQ(score.paper.mean.iou, 1);
  EXPECT_DOUBLE_EQ(score.paper.mean.accuracy, 1);
  EXPECT_DOUBLE_EQ(score.paper.mean.boundary_iou, 1);
  const double left = Area(Left(1)), pair = Area(Pair(1));
  ASSERT_TRUE(score.reference_choice);
  EXPECT_EQ(score.reference_choice->scale, 0.3);
  EXPECT_DOUBLE_EQ(score.reference_choice->mean.iou, left / pair);
  EXPECT_DOUBLE_EQ(score.reference_choice->mean.accuracy,
                   1 - (pair - left) / (kTwoBlobsSize * kTwoBlobsSize));
  ASSERT_EQ(score.iou_by_scale.size(), options_.scales.size());
  for (size_t s = 0; s < options_.scales.size(); ++s) {
    EXPECT_DOUBLE_EQ(score.iou_by_scale[s], options_.scales[s] > 0.5 ? 1 : left / pair) << s;
  }
  // The blobs are apart at more scales than together.
  EXPECT_NEAR(score.automatic.mean.iou, left / pair, 0.02);
  EXPECT_EQ(score.automatic.views.size(), 1u);
}

TEST_F(EvaluateTest, ScoresEntitiesThatOverlapAndJoinsThemByCategory) {
  for (int v = 0; v < 3; ++v) {
    Show(v, "blob.1", Left(v));
    Show(v, "blob.2", v == 0 ? Right(v) : Pair(v));
    Show(v, "pair", Pair(v));
  }
  ASSERT_OK_AND_ASSIGN(const EvaluationResult result, Run());
  ASSERT_EQ(result.entities.size(), 3u);
  EXPECT_DOUBLE_EQ(result.entities[0].reference_choice->mean.iou, 1);
  const double half = result.entities[1].reference_choice->mean.iou;
  EXPECT_NEAR(half, 0.5, 0.02);
  EXPECT_DOUBLE_EQ(result.entities[2].reference_choice->mean.iou, 1);
  EXPECT_EQ(result.entities[2].reference_choice->scale, 0.8);
  ASSERT_EQ(result.categories.size(), 2u);
  EXPECT_EQ(result.categories[0].name, "blob");
  EXPECT_EQ(result.categories[0].num_entities, 2);
  EXPECT_DOUBLE_EQ(result.categories[0].reference_choice->iou, (1 + half) / 2);
  EXPECT_EQ(result.categories[1].name, "pair");
  EXPECT_EQ(result.scene.num_entities, 3);
  EXPECT_DOUBLE_EQ(result.scene.reference_choice->iou, (2 + half) / 3);
  EXPECT_DOUBLE_EQ(result.scene.paper.iou, 1);
}

// The cosine of the blobs is 0.65 at scale 0.56, under the default threshold of a query.
TEST_F(EvaluateTest, ChoosesThresholdsAboveAndBelowThatOfTheQuery) {
  for (int v = 0; v < 2; ++v) {
    Show(v, "left", Left(v));
    Show(v, "pair", Pair(v));
  }
  options_.scales = {0.56};
  options_.thresholds = {0.4, 0.6, 0.8, 0.9};
  for (const double threshold : {0.5, 0.7}) {
    options_.fixed_threshold = threshold;
    ASSERT_OK_AND_ASSIGN(const EvaluationResult result, Run());
    EXPECT_EQ(result.entities[0].reference_choice->threshold, 0.8);
    EXPECT_DOUBLE_EQ(result.entities[0].reference_choice->mean.iou, 1);
    EXPECT_EQ(result.entities[1].paper.threshold, 0.4);
    EXPECT_DOUBLE_EQ(result.entities[1].paper.mean.iou, 1);
    const bool together = threshold < 0.65;
    EXPECT_NEAR(result.entities[0].iou_by_scale[0], together ? 0.5 : 1, 0.02);
    EXPECT_NEAR(result.entities[1].iou_by_scale[0], together ? 1 : 0.5, 0.02);
  }
}

// The truth is the mask as the threshold gives it, so that a refined border is an error here.
TEST_F(EvaluateTest, RefinesTheBordersOfScoredMasks) {
  for (const int v : {0, 1}) Show(v, "left", Left(v));
  options_.scales = {0.5};
  options_.thresholds = {0.97};
  ASSERT_OK_AND_ASSIGN(const EvaluationResult plain, Run());
  options_.refine_borders = true;
  ASSERT_OK_AND_ASSIGN(const EvaluationResult refined, Run());
  EXPECT_EQ(plain.scene.reference_choice->iou, 1);
  EXPECT_LT(refined.scene.reference_choice->iou, 1);
  EXPECT_GT(refined.scene.reference_choice->iou, 0.97);
  EXPECT_EQ(refined.scene.paper.iou, refined.scene.reference_choice->iou);
}

TEST_F(EvaluateTest, ScoresZeroForAMissingPredictionInEachProtocol) {
  for (int v = 0; v < 3; ++v) {
    Show(v, "left", Left(v));
    Show(v, "rows", BottomRows(2));
  }
  for (const Protocol protocol : {Protocol::kPrompt, Protocol::kLabelPropagation,
                                  Protocol::kLabelPropagationPixels, Protocol::kPromptable}) {
    SCOPED_TRACE(static_cast<int>(protocol));
    options_.protocol = protocol;
    ASSERT_OK_AND_ASSIGN(const EvaluationResult result, Run());
    const EntityScores& rows = result.entities[1];
    EXPECT_TRUE(rows.missing);
    EXPECT_FALSE(result.entities[0].missing);
    for (const ChoiceScores* choice : {&rows.paper, &*rows.reference_choice, &rows.automatic}) {
      EXPECT_EQ(choice->mean.iou, 0);
      EXPECT_EQ(choice->mean.accuracy, 0);
      EXPECT_EQ(choice->mean.boundary_iou, 0);
      EXPECT_EQ(choice->views.size(), 2u);
    }
    EXPECT_EQ(rows.iou_by_scale, std::vector<double>(11, 0.0));
    EXPECT_NEAR(result.scene.paper.iou, 0.5, 0.02);
  }
}

// The right half is ignored: what spills into the right blob is not seen, and not clustered.
TEST_F(EvaluateTest, NeitherClicksNorScoresIgnoredPixels) {
  for (int v = 0; v < 3; ++v) Show(v, "pair", Pair(v));
  ignore_.resize(size_t{kTwoBlobsSize} * kTwoBlobsSize);
  for (int i = 0; i < kTwoBlobsSize * kTwoBlobsSize; ++i)
    ignore_[i] = i % kTwoBlobsSize >= 48 ? 1 : 0;
  for (const Protocol protocol : {Protocol::kPrompt, Protocol::kLabelPropagation,
                                  Protocol::kLabelPropagationPixels, Protocol::kPromptable}) {
    SCOPED_TRACE(static_cast<int>(protocol));
    options_.protocol = protocol;
    ASSERT_OK_AND_ASSIGN(const EvaluationResult result, Run());
    const EntityScores& score = result.entities[0];
    EXPECT_EQ(score.num_pixels[0], static_cast<int64_t>(Area(Left(1))));
    EXPECT_NEAR(score.click->x, 32.5, 1);
    for (const double iou : score.iou_by_scale) EXPECT_GT(iou, 0.95);
    EXPECT_GT(score.automatic.mean.iou, 0.95);
    EXPECT_GT(score.automatic.mean.accuracy, 0.99);
  }
  options_.protocol = Protocol::kClicks;
  ASSERT_OK_AND_ASSIGN(const EvaluationResult result, Run());
  EXPECT_EQ(result.scene.num_clicks, 1);
}

// The outer pixels of the blob are void, as in label images of PASCAL VOC. Predictions have them.
TEST_F(EvaluateTest, LeavesVoidPixelsOutOfAllScoresAndCountsThem) {
  EvaluationRequest request;
  int64_t num_void = 0;
  for (int v = 0; v < 3; ++v) {
    const Mask left = Left(v), rim = MaskBoundary(left, kTwoBlobsSize, kTwoBlobsSize, 1);
    std::vector<uint16_t> labels;
    for (size_t i = 0; i < left.size(); ++i) labels.push_back(rim[i] != 0 ? 255 : left[i]);
    TruthViewBuilder builder(segmenter_->model().views[v]);
    ASSERT_OK(builder.AddLabels(labels, {{1, "left"}}, 255));
    request.views.push_back(std::move(builder).Build());
    num_void += static_cast<int64_t>(Area(rim));
  }
  for (const Protocol protocol : {Protocol::kPrompt, Protocol::kLabelPropagation,
                                  Protocol::kLabelPropagationPixels, Protocol::kPromptable}) {
    SCOPED_TRACE(static_cast<int>(protocol));
    options_.protocol = protocol;
    ASSERT_OK_AND_ASSIGN(const EvaluationResult result,
                         Evaluate(*segmenter_, request, options_, GoOn));
    ASSERT_EQ(result.entities.size(), 1u);
    EXPECT_EQ(result.scene.paper.iou, 1);
    EXPECT_EQ(result.scene.paper.accuracy, 1);
    EXPECT_EQ(result.scene.paper.boundary_iou, 1);
    EXPECT_EQ(result.num_void, num_void);
  }
  options_.protocol = Protocol::kClicks;
  ASSERT_OK_AND_ASSIGN(const EvaluationResult result,
                       Evaluate(*segmenter_, request, options_, GoOn));
  EXPECT_EQ(result.scene.iou_after[0], 1);
  EXPECT_EQ(result.num_void, num_void);
}

TEST_F(EvaluateTest, ScoresTheReferenceAndTrainedViewsIfAsked) {
  Show(0, "left", Left(0));
  options_.task.score_reference = true;
  EvaluationRequest request = Request();
  for (TruthView& truth : request.views) truth.view.held_out = false;
  EXPECT_STATUS(Evaluate(*segmenter_, request, options_, GoOn), absl::StatusCode::kInvalidArgument,
                "view \"a\" was trained on");
  request.accept_trained_views = true;
  ASSERT_OK_AND_ASSIGN(const EvaluationResult result,
                       Evaluate(*segmenter_, request, options_, GoOn));
  EXPECT_EQ(result.entities[0].scored, std::vector<std::string>{"a"});
  EXPECT_DOUBLE_EQ(result.entities[0].reference_choice->mean.iou, 1);
  EXPECT_DOUBLE_EQ(result.entities[0].paper.mean.iou, 1);
}

TEST_F(EvaluateTest, RunsTheAgreementWithSam) {
  options_.protocol = Protocol::kSamAgreement;
  EvaluationRequest request;
  SamView& sam = request.sam_views.emplace_back();
  sam.view = segmenter_->model().views[1];
  sam.masks =
      BuildMaskSet(kTwoBlobsSize, kTwoBlobsSize, std::vector<BinaryMask>{{Left(1)}, {Pair(1)}}, 1);
  ASSERT_OK_AND_ASSIGN(const EvaluationResult result,
                       Evaluate(*segmenter_, request, options_, GoOn));
  ASSERT_TRUE(result.sam);
  EXPECT_DOUBLE_EQ(result.sam->best_iou, 1);
  EXPECT_TRUE(result.entities.empty());
  sam.view.held_out = false;
  EXPECT_STATUS(Evaluate(*segmenter_, request, options_, GoOn), absl::StatusCode::kInvalidArgument,
                "view \"b\" was trained on");
  request.accept_trained_views = true;
  EXPECT_OK(Evaluate(*segmenter_, request, options_, GoOn));
}

TEST_F(EvaluateTest, RendersEachViewOnceWhileTheCacheHoldsIt) {
  for (int v = 0; v < 3; ++v) {
    Show(v, "left", Left(v));
    Show(v, "pair", Pair(v));
  }
  MakeModel(10);  // an empty cache
  for (const Protocol protocol :
       {Protocol::kPrompt, Protocol::kLabelPropagation, Protocol::kLabelPropagationPixels,
        Protocol::kPromptable, Protocol::kClicks}) {
    options_.protocol = protocol;
    ASSERT_OK(Run());
    EXPECT_EQ(segmenter_->num_renders(), 3);
  }
}

TEST_F(EvaluateTest, ReturnsTheErrorOfCheckCancelled) {
  for (int v = 0; v < 3; ++v) Show(v, "left", Left(v));
  for (const Protocol protocol :
       {Protocol::kPrompt, Protocol::kLabelPropagation, Protocol::kLabelPropagationPixels,
        Protocol::kPromptable, Protocol::kClicks}) {
    SCOPED_TRACE(static_cast<int>(protocol));
    options_.protocol = protocol;
    int total = 0;
    ASSERT_OK(Evaluate(*segmenter_, Request(), options_, [&] {
      ++total;
      return absl::OkStatus();
    }));
    EXPECT_GE(total, 3);
    for (const int allowed : {0, total / 2, total - 1}) {
      int asked = 0;
      const auto result = Evaluate(*segmenter_, Request(), options_, [&] {
        return asked++ < allowed ? absl::OkStatus() : absl::CancelledError("enough");
      });
      EXPECT_STATUS(result, absl::StatusCode::kCancelled, "enough");
      EXPECT_EQ(asked, allowed + 1);
    }
  }
}

TEST_F(EvaluateTest, RefusesInvalidOptions) {
  const auto expect_refused = [](auto change, const std::string& message) {
    EvaluationOptions options;
    change(options);
    EXPECT_STATUS(Validate(options), absl::StatusCode::kInvalidArgument, message);
  };
  EXPECT_OK(Validate(EvaluationOptions()));
  expect_refused([](auto& o) { o.scales = {}; }, "scales has 0 values, must have 1..100");
  expect_refused(
      [](auto& o) {
        o.thresholds = {0.5, 0.5};
      },
      "thresholds[1] is 0.5, must be in [-1");
  expect_refused([](auto& o) { o.fixed_threshold = NAN; }, "fixed_threshold is nan");
  expect_refused([](auto& o) { o.task.min_pixels = 0; }, "min_pixels is 0");
  expect_refused([](auto& o) { o.label_propagation.min_cosine = -2; },
                 "label_propagation.min_cosine is -2, must be in [-1, 1]");
  expect_refused([](auto& o) { o.label_propagation.min_inside = 0; },
                 "label_propagation.min_inside is 0, must be in (0, 1]");
  expect_refused([](auto& o) { o.label_propagation.max_pixels = 1; },
                 "label_propagation.max_pixels is 1, must be in [64, 65536]");
  expect_refused([](auto& o) { o.promptable.min_cosine = 1.5; },
                 "promptable.min_cosine is 1.5, must be in [-1, 1]");
  expect_refused([](auto& o) { o.promptable.max_points = 0; }, "promptable.max_points is 0");
  expect_refused([](auto& o) { o.clicks.max_clicks = 2; }, "max_clicks is 2");
  expect_refused([](auto& o) { o.sam.num_proposals = 0; }, "sam_agreement.num_proposals is 0");
}

}  // namespace
}  // namespace pepeseg
