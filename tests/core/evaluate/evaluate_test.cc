#include "core/evaluate/evaluate.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "core/evaluate/one_click.h"
#include "core/evaluate/segmentation_metrics.h"
#include "tests/core/evaluate/two_blobs.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

constexpr int kSize = testing::kTwoBlobsSize;

using Mask = std::vector<uint8_t>;

absl::Status GoOn() { return absl::OkStatus(); }

Mask Union(Mask a, const Mask& b) {
  for (size_t i = 0; i < a.size(); ++i) a[i] |= b[i];
  return a;
}

// Rows from the bottom of the image, where nothing is rendered.
Mask BottomRows(int num_rows) {
  Mask mask(size_t{kSize} * kSize);
  std::fill(mask.end() - ptrdiff_t{num_rows} * kSize, mask.end(), uint8_t{1});
  return mask;
}

double Area(const Mask& mask) {
  return static_cast<double>(std::count(mask.begin(), mask.end(), uint8_t{1}));
}

class EvaluateTest : public ::testing::Test {
 protected:
  void SetUp() override { MakeModel(10); }

  void MakeModel(float gate_bias) {
    ASSERT_OK_AND_ASSIGN(segmenter_, Segmenter::Create(*backend_, testing::TwoBlobs(gate_bias)));
  }

  // The masks of the blobs, by a model whose blobs are apart at small scales.
  Mask Left(int view) const { return Blob(view, true); }
  Mask Right(int view) const { return Blob(view, false); }
  Mask Pair(int view) const { return Union(Left(view), Right(view)); }

  // Adds a mask of an entity to the request.
  void Show(int view, const std::string& entity, const Mask& mask) { masks_[view][entity] = mask; }

  EvaluationRequest Request() const {
    EvaluationRequest request;
    for (int v = 0; v < 3; ++v) {
      TruthViewBuilder builder(segmenter_->model().views[v]);
      if (masks_.contains(v)) {
        for (const auto& [entity, mask] : masks_.at(v)) EXPECT_OK(builder.AddMask(entity, mask));
      }
      if (!ignore_.empty()) {
        EXPECT_OK(builder.SetIgnore(ignore_));
      }
      request.views.push_back(std::move(builder).Build());
    }
    request.prompts = prompts_;
    return request;
  }
  absl::StatusOr<EvaluationResult> Run() const {
    return Evaluate(*segmenter_, Request(), options_, GoOn);
  }

  std::unique_ptr<Backend> backend_ = MakeCpuBackend(2);
  std::unique_ptr<Segmenter> segmenter_;
  std::map<int, std::map<std::string, Mask>> masks_;
  std::vector<EntityPrompt> prompts_;
  Mask ignore_;  // of all views
  EvaluationOptions options_;

 private:
  Mask Blob(int view, bool left) const { return testing::MaskOfBlob(*segmenter_, view, left); }
};

// Label images cannot overlap: in view "b" entity 8 has both blobs, in "c" half of the left one.
TEST_F(EvaluateTest, GivesTheNumbersOfEvaluateOneClick) {
  std::vector<LabeledView> labeled;
  for (int v = 0; v < 3; ++v) {
    LabeledView& view = labeled.emplace_back();
    view.view = segmenter_->model().views[v];
    const Mask left = Left(v), right = Right(v), rows = BottomRows(v == 2 ? 1 : 0);
    for (int i = 0; i < kSize * kSize; ++i) {
      const bool left_is_8 = v == 1 || (v == 2 && i % kSize < 32);
      const bool is_8 = right[i] != 0 || (left[i] != 0 && left_is_8);
      view.labels.push_back(is_8 ? 8 : left[i] != 0 || rows[i] != 0 ? 3 : 0);
    }
    for (const uint16_t id : {3, 8}) {
      if (const Mask mask = view.MaskOf(id); Area(mask) > 0) Show(v, std::to_string(id), mask);
    }
  }
  ASSERT_OK_AND_ASSIGN(const OneClickScores old, EvaluateOneClick(*segmenter_, labeled, {}, GoOn));
  ASSERT_OK_AND_ASSIGN(const EvaluationResult result, Run());
  ASSERT_EQ(result.entities.size(), 2u);
  for (size_t i = 0; i < 2; ++i) {
    const EntityScores& score = result.entities[i];
    EXPECT_EQ(score.name, std::to_string(old.entities[i].id));
    EXPECT_EQ(score.click->x, old.entities[i].click.x);
    EXPECT_EQ(score.click->y, old.entities[i].click.y);
    const auto expect_same = [](const ChoiceScores& choice, const OneClickChoice& expected) {
      EXPECT_EQ(choice.scale, expected.scale);
      EXPECT_EQ(choice.threshold, expected.threshold);
      EXPECT_DOUBLE_EQ(choice.mean.iou, expected.iou);
      EXPECT_NEAR(choice.mean.boundary_iou, expected.boundary_iou, 1e-12);
    };
    expect_same(score.paper, old.entities[i].oracle);
    ASSERT_TRUE(score.reference_choice);
    expect_same(*score.reference_choice, old.entities[i].chosen);
    ASSERT_EQ(score.iou_by_scale.size(), old.entities[i].fixed_iou.size());
    for (size_t s = 0; s < score.iou_by_scale.size(); ++s) {
      EXPECT_DOUBLE_EQ(score.iou_by_scale[s], old.entities[i].fixed_iou[s]);
    }
  }
  EXPECT_LT(result.scene.reference_choice->iou, result.scene.paper.iou);
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
  EXPECT_EQ(score.reference_choice->scale, 0.01);
  EXPECT_DOUBLE_EQ(score.reference_choice->mean.iou, left / pair);
  EXPECT_DOUBLE_EQ(score.reference_choice->mean.accuracy, 1 - (pair - left) / (kSize * kSize));
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
  EXPECT_EQ(result.entities[2].reference_choice->scale, 0.6);
  ASSERT_EQ(result.categories.size(), 2u);
  EXPECT_EQ(result.categories[0].name, "blob");
  EXPECT_EQ(result.categories[0].num_entities, 2);
  EXPECT_DOUBLE_EQ(result.categories[0].reference_choice->iou, (1 + half) / 2);
  EXPECT_EQ(result.categories[1].name, "pair");
  EXPECT_EQ(result.scene.num_entities, 3);
  EXPECT_DOUBLE_EQ(result.scene.reference_choice->iou, (2 + half) / 3);
  EXPECT_DOUBLE_EQ(result.scene.paper.iou, 1);
}

// The reference view has no mask of the entity; one other view has.
TEST_F(EvaluateTest, FindsTheEntityByEachKindOfPrompt) {
  Show(1, "left", Left(1));
  Mask strip(size_t{kSize} * kSize), other(strip.size());
  for (int x = 28; x < 37; ++x) strip[48 * kSize + x] = other[48 * kSize + x + 32] = 1;
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
TEST_F(EvaluateTest, LeavesOutWhatNegativePointsClaim) {
  for (int v = 0; v < 2; ++v) Show(v, "left", Left(v));
  options_.scales = {0.6};
  prompts_ = {{"left", "a", std::vector<PointPrompt>{{32.5, 48.5, true}}}};
  ASSERT_OK_AND_ASSIGN(EvaluationResult result, Run());
  EXPECT_NEAR(result.entities[0].iou_by_scale[0], 0.5, 0.02);
  prompts_ = {{"left", "a", std::vector<PointPrompt>{{32.5, 48.5, true}, {64.5, 48.5, false}}}};
  ASSERT_OK_AND_ASSIGN(result, Run());
  EXPECT_DOUBLE_EQ(result.entities[0].iou_by_scale[0], 1);
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

// Cosine of the blobs: 0 at scale 0.5, 0.89 at 0.6, 0.999 at 0.7.
TEST_F(EvaluateTest, PropagatesTheClustersThatTheReferenceMaskSelects) {
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

TEST_F(EvaluateTest, RefusesToPropagateAPromptWithoutAMask) {
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
  Mask inside;
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

// The gated features of the blobs are (0.5, p) and (0.5, -p), with p from 1 at small scales to 0 at
// large ones; their mean is the first axis, whose cosine with both is half the angle's.
TEST_F(EvaluateTest, MatchesTheMeanFeatureOfTheReferenceMask) {
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

TEST_F(EvaluateTest, MatchesTheMeanOfPointsAndOfPositiveScribbles) {
  options_.protocol = Protocol::kPromptable;
  options_.scales = {0.1, 0.6};
  Show(1, "pair", Pair(1));
  const std::vector<PointPrompt> points = {{32.5, 48.5, true}, {64.5, 48.5, true}};
  Mask stroke(size_t{kSize} * kSize);
  for (const PointPrompt& point : points) stroke[48 * kSize + static_cast<size_t>(point.x)] = 1;
  for (const PromptShape& shape : {PromptShape(points), PromptShape(PointMean{points}),
                                   PromptShape(Scribbles{{stroke}, {}})}) {
    prompts_ = {{"pair", "a", shape}};
    ASSERT_OK_AND_ASSIGN(const EvaluationResult result, Run());
    EXPECT_EQ(result.entities[0].iou_by_scale[0], 0);
    EXPECT_GT(result.entities[0].iou_by_scale[1], 0.95);
  }
}

TEST_F(EvaluateTest, CountsClicksAsEvaluateClicksDoes) {
  options_.protocol = Protocol::kClicks;
  std::vector<LabeledView> labeled;
  for (int v = 0; v < 3; ++v) {
    Show(v, "left", Left(v));
    LabeledView& view = labeled.emplace_back();
    view.view = segmenter_->model().views[v];
    for (const uint8_t inside : Left(v)) view.labels.push_back(inside);
  }
  MakeModel(2);  // together at most scales: the first click takes both blobs
  ASSERT_OK_AND_ASSIGN(const ClickScores old,
                       EvaluateClicks(*segmenter_, labeled, {.max_clicks = 10}, GoOn));
  ASSERT_OK_AND_ASSIGN(EvaluationResult result, Run());
  ASSERT_TRUE(result.entities[0].clicks);
  const EntityClicks& clicks = *result.entities[0].clicks;
  EXPECT_EQ(clicks.num_clicks, 2);
  EXPECT_TRUE(clicks.reached);
  EXPECT_EQ(clicks.iou_after, old.entities[0].iou_after);
  EXPECT_NEAR(clicks.iou_after[0], 0.5, 0.02);
  EXPECT_GT(clicks.iou_after[1], 0.95);
  EXPECT_EQ(result.scene.num_clicks, old.num_clicks);
  EXPECT_EQ(result.scene.reached, 1);
  EXPECT_EQ(result.scene.iou_after, old.iou_after);
  EXPECT_EQ(result.categories[0].num_clicks, 2);

  prompts_ = {{"left", "a", OwnMask{}}};
  EXPECT_STATUS(Run(), absl::StatusCode::kInvalidArgument,
                "entity \"left\", reference view \"a\": the protocol \"clicks\" makes its own "
                "prompt");
}

TEST_F(EvaluateTest, CountsMaxClicksForAnEntityNeverReached) {
  options_.protocol = Protocol::kClicks;
  for (int v = 0; v < 2; ++v) Show(v, "left", Union(Left(v), BottomRows(20)));
  ASSERT_OK_AND_ASSIGN(const EvaluationResult result, Run());
  EXPECT_FALSE(result.entities[0].clicks->reached);
  EXPECT_EQ(result.entities[0].clicks->num_clicks, 10);
  EXPECT_EQ(result.scene.num_clicks, 10);
  EXPECT_EQ(result.scene.reached, 0);
}

TEST_F(EvaluateTest, ScoresZeroForAMissingPredictionInEachProtocol) {
  for (int v = 0; v < 3; ++v) {
    Show(v, "left", Left(v));
    Show(v, "rows", BottomRows(2));
  }
  for (const Protocol protocol :
       {Protocol::kPrompt, Protocol::kLabelPropagation, Protocol::kPromptable}) {
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
  ignore_.resize(size_t{kSize} * kSize);
  for (int i = 0; i < kSize * kSize; ++i) ignore_[i] = i % kSize >= 48 ? 1 : 0;
  for (const Protocol protocol :
       {Protocol::kPrompt, Protocol::kLabelPropagation, Protocol::kPromptable}) {
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
  sam.masks = BuildMaskSet(kSize, kSize, std::vector<BinaryMask>{{Left(1)}, {Pair(1)}}, 1);
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
       {Protocol::kPrompt, Protocol::kLabelPropagation, Protocol::kPromptable, Protocol::kClicks}) {
    options_.protocol = protocol;
    ASSERT_OK(Run());
    EXPECT_EQ(segmenter_->num_renders(), 3);
  }
}

TEST_F(EvaluateTest, ReturnsTheErrorOfCheckCancelled) {
  for (int v = 0; v < 3; ++v) Show(v, "left", Left(v));
  for (const Protocol protocol :
       {Protocol::kPrompt, Protocol::kLabelPropagation, Protocol::kPromptable, Protocol::kClicks}) {
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
  expect_refused([](auto& o) { o.label_propagation.hdbscan.min_cluster_size = 1; },
                 "label_propagation.hdbscan: ");
  expect_refused([](auto& o) { o.promptable.min_cosine = 1.5; },
                 "promptable.min_cosine is 1.5, must be in [-1, 1]");
  expect_refused([](auto& o) { o.promptable.max_points = 0; }, "promptable.max_points is 0");
  expect_refused([](auto& o) { o.clicks.max_clicks = 2; }, "max_clicks is 2");
  expect_refused([](auto& o) { o.sam.num_proposals = 0; }, "sam_agreement.num_proposals is 0");
}

}  // namespace
}  // namespace pepeseg
