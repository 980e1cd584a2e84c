#include "core/evaluate/one_click.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/evaluate/segmentation_metrics.h"
#include "tests/core/evaluate/two_blobs.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

constexpr int kSize = testing::kTwoBlobsSize;
constexpr uint16_t kLeft = 3, kRight = 8;

absl::Status GoOn() { return absl::OkStatus(); }

class OneClickTest : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_OK_AND_ASSIGN(segmenter_, Segmenter::Create(*backend_, testing::TwoBlobs()));
    for (const ModelView& view : segmenter_->model().views) {
      LabeledView& labeled = views_.emplace_back();
      labeled.view = view;
      labeled.labels.assign(size_t{kSize} * kSize, 0);
    }
  }

  std::vector<uint8_t> Blob(int view, bool left) const {
    return testing::MaskOfBlob(*segmenter_, view, left);
  }
  // Gives the pixels of a mask to an entity; returns how many there are.
  static double Paint(LabeledView& view, const std::vector<uint8_t>& mask, uint16_t id) {
    for (size_t i = 0; i < mask.size(); ++i) {
      if (mask[i] != 0) view.labels[i] = id;
    }
    return static_cast<double>(std::count(mask.begin(), mask.end(), 1));
  }
  // Rows of an entity from the bottom of the image, where nothing is rendered.
  static void PaintRows(LabeledView& view, int num_rows, uint16_t id) {
    std::fill(view.labels.end() - ptrdiff_t{num_rows} * kSize, view.labels.end(), id);
  }
  absl::StatusOr<OneClickScores> Evaluate() const {
    return EvaluateOneClick(*segmenter_, views_, options_, GoOn);
  }

  std::unique_ptr<Backend> backend_ = MakeCpuBackend(2);
  std::unique_ptr<Segmenter> segmenter_;
  std::vector<LabeledView> views_;
  OneClickOptions options_;
};

TEST_F(OneClickTest, ScoresTheOtherViewsAtWhatTheReferenceChose) {
  for (int v = 0; v < 3; ++v) Paint(views_[v], Blob(v, true), kLeft);
  const double area_b = Paint(views_[1], Blob(1, true), kLeft);
  const double area_c = Paint(views_[2], Blob(2, true), kLeft);
  PaintRows(views_[1], 1, kLeft);  // 96 pixels that no click finds
  PaintRows(views_[2], 2, kLeft);
  ASSERT_OK_AND_ASSIGN(const OneClickScores scores, Evaluate());
  ASSERT_EQ(scores.entities.size(), 1u);
  const EntityScore& score = scores.entities[0];
  EXPECT_EQ(score.id, kLeft);
  EXPECT_FALSE(score.missing);
  ASSERT_EQ(score.views.size(), 3u);
  EXPECT_EQ(score.views[0].view, "a");
  // Every scale up to 0.5 and every threshold finds the blob alone: the first pair is taken.
  EXPECT_EQ(score.chosen.scale, 0.01);
  EXPECT_EQ(score.chosen.threshold, 0.5);
  const double iou_b = area_b / (area_b + 96), iou_c = area_c / (area_c + 192);
  EXPECT_DOUBLE_EQ(score.views[0].iou, 1);
  EXPECT_DOUBLE_EQ(score.views[0].boundary_iou, 1);
  EXPECT_DOUBLE_EQ(score.views[1].iou, iou_b);
  EXPECT_DOUBLE_EQ(score.views[2].iou, iou_c);
  EXPECT_DOUBLE_EQ(score.chosen.iou, (iou_b + iou_c) / 2);
  EXPECT_DOUBLE_EQ(scores.chosen.iou, score.chosen.iou);
  EXPECT_EQ(score.views[1].num_pixels, static_cast<int64_t>(area_b) + 96);
  double boundary = 0;
  for (const int v : {1, 2}) {
    boundary += BoundaryIou(Blob(v, true), views_[v].MaskOf(kLeft), kSize, kSize) / 2;
  }
  EXPECT_NEAR(score.chosen.boundary_iou, boundary, 1e-12);
}

TEST_F(OneClickTest, ChoosesOnTheReferenceAloneAndTheOracleOnTheScoredViews) {
  const double left = Paint(views_[0], Blob(0, true), kLeft);
  const double left_b = Paint(views_[1], Blob(1, true), kLeft);
  const double right_b = Paint(views_[1], Blob(1, false), kLeft);
  ASSERT_OK_AND_ASSIGN(const OneClickScores scores, Evaluate());
  const EntityScore& score = scores.entities[0];
  EXPECT_EQ(score.chosen.scale, 0.01);
  EXPECT_DOUBLE_EQ(score.chosen.iou, left_b / (left_b + right_b));
  // The smallest scale, and the lowest threshold, of those that take both blobs.
  EXPECT_EQ(score.oracle.scale, 0.6);
  EXPECT_EQ(score.oracle.threshold, 0.5);
  EXPECT_DOUBLE_EQ(score.oracle.iou, 1);
  EXPECT_DOUBLE_EQ(score.oracle.boundary_iou, 1);
  EXPECT_DOUBLE_EQ(scores.oracle.iou, 1);
  ASSERT_EQ(score.fixed_iou.size(), options_.fixed_scales.size());
  for (size_t k = 0; k < score.fixed_iou.size(); ++k) {
    const bool both = options_.fixed_scales[k] > 0.5;
    EXPECT_DOUBLE_EQ(score.fixed_iou[k], both ? 1 : left_b / (left_b + right_b)) << k;
    const double on_reference = score.views[0].fixed_iou[k];
    EXPECT_NEAR(on_reference, both ? left / (2 * left) : 1, 0.02) << k;  // blobs of one size
  }
}

TEST_F(OneClickTest, ScoresZeroForAMissingPrediction) {
  for (LabeledView& view : views_) PaintRows(view, 2, kRight);
  for (int v = 0; v < 3; ++v) Paint(views_[v], Blob(v, true), kLeft);
  ASSERT_OK_AND_ASSIGN(const OneClickScores scores, Evaluate());
  ASSERT_EQ(scores.entities.size(), 2u);
  EXPECT_DOUBLE_EQ(scores.entities[0].chosen.iou, 1);
  const EntityScore& missing = scores.entities[1];
  EXPECT_EQ(missing.id, kRight);
  EXPECT_TRUE(missing.missing);
  EXPECT_EQ(missing.chosen.iou, 0);
  EXPECT_EQ(missing.chosen.boundary_iou, 0);
  EXPECT_EQ(missing.oracle.iou, 0);
  EXPECT_EQ(missing.fixed_iou, std::vector<double>(11, 0.0));
  EXPECT_DOUBLE_EQ(scores.chosen.iou, 0.5);
  EXPECT_DOUBLE_EQ(scores.chosen.boundary_iou, 0.5);
  EXPECT_DOUBLE_EQ(scores.oracle.iou, 0.5);
  EXPECT_DOUBLE_EQ(scores.fixed_iou[0], 0.5);
}

TEST_F(OneClickTest, TakesTheFirstViewByNameWithEnoughPixelsAsReference) {
  for (int v = 0; v < 3; ++v) Paint(views_[v], Blob(v, true), kLeft);
  // View "a" keeps 99 pixels.
  int remain = 99;
  for (uint16_t& label : views_[0].labels) {
    if (label == kLeft && remain-- <= 0) label = 0;
  }
  std::swap(views_[1], views_[2]);
  ASSERT_OK_AND_ASSIGN(OneClickScores scores, Evaluate());
  ASSERT_EQ(scores.entities[0].views.size(), 2u);
  EXPECT_EQ(scores.entities[0].views[0].view, "b");
  EXPECT_EQ(scores.entities[0].views[1].view, "c");
  EXPECT_NEAR(scores.entities[0].click.x, 32.5, 1);
  EXPECT_NEAR(scores.entities[0].click.y, 50.5, 1);
  options_.min_pixels = 99;
  ASSERT_OK_AND_ASSIGN(scores, Evaluate());
  EXPECT_EQ(scores.entities[0].views[0].view, "a");
}

TEST_F(OneClickTest, LeavesOutAnEntityOfOneView) {
  for (int v = 0; v < 3; ++v) Paint(views_[v], Blob(v, true), kLeft);
  Paint(views_[1], Blob(1, false), kRight);
  ASSERT_OK_AND_ASSIGN(const OneClickScores scores, Evaluate());
  EXPECT_EQ(scores.entities.size(), 1u);
  EXPECT_EQ(scores.left_out, std::vector<int>{kRight});
  for (LabeledView& view : views_) std::fill(view.labels.begin(), view.labels.end(), 0);
  EXPECT_STATUS(Evaluate(), absl::StatusCode::kInvalidArgument,
                "no entity shows at least 100 pixels in at least 2 of the 3 labelled views");
}

TEST_F(OneClickTest, TakesFixedScalesAndThresholdOutsideTheGrid) {
  for (int v = 0; v < 3; ++v) {
    Paint(views_[v], Blob(v, true), kLeft);
    Paint(views_[v], Blob(v, false), kLeft);
  }
  options_.scales = {0.01, 0.7};
  options_.thresholds = {0.6};
  options_.fixed_scales = {0.6};
  options_.fixed_threshold = 0.88;
  ASSERT_OK_AND_ASSIGN(OneClickScores scores, Evaluate());
  EXPECT_EQ(scores.entities[0].chosen.scale, 0.7);
  EXPECT_EQ(scores.entities[0].chosen.threshold, 0.6);
  EXPECT_EQ(scores.fixed_iou, std::vector{1.0});
  options_.fixed_threshold = 0.9;  // over the cosine of the two blobs
  ASSERT_OK_AND_ASSIGN(scores, Evaluate());
  EXPECT_NEAR(scores.fixed_iou[0], 0.5, 0.02);
}

TEST_F(OneClickTest, NeitherClicksNorScoresIgnoredPixels) {
  options_.min_pixels = 40;  // half of a blob is ignored
  for (int v = 0; v < 3; ++v) Paint(views_[v], Blob(v, true), kLeft);
  PaintRows(views_[1], 1, kLeft);
  for (LabeledView& view : views_) {
    view.ignore.assign(view.labels.size(), 0);
    std::fill(view.ignore.end() - kSize, view.ignore.end(), 1);
    for (int i = 0; i < kSize * kSize; ++i) {
      if (i % kSize < 32) view.ignore[i] = 1;
    }
  }
  ASSERT_OK_AND_ASSIGN(const OneClickScores scores, Evaluate());
  EXPECT_DOUBLE_EQ(scores.chosen.iou, 1);
  EXPECT_GT(scores.entities[0].click.x, 33);
}

TEST_F(OneClickTest, ReturnsTheErrorOfCheckCancelled) {
  for (int v = 0; v < 3; ++v) Paint(views_[v], Blob(v, true), kLeft);
  for (const int allowed : {0, 1, 20, 36}) {  // fails before the click, a table, a boundary
    int asked = 0;
    const auto scores = EvaluateOneClick(*segmenter_, views_, options_, [&] {
      return asked++ < allowed ? absl::OkStatus() : absl::CancelledError("enough");
    });
    EXPECT_STATUS(scores, absl::StatusCode::kCancelled, "enough");
    EXPECT_EQ(asked, allowed + 1);
  }
}

TEST_F(OneClickTest, RefusesInvalidOptions) {
  const auto expect_refused = [](const OneClickOptions& options, const std::string& message) {
    EXPECT_STATUS(Validate(options), absl::StatusCode::kInvalidArgument, message);
  };
  EXPECT_OK(Validate(OneClickOptions()));
  expect_refused({.scales = {}}, "scales has 0 values, must have 1..100");
  expect_refused({.scales = {0.1, 0.1}}, "scales[1] is 0.1, must be in [0, 1] and ascend");
  expect_refused({.thresholds = {NAN}}, "thresholds[0] is nan");
  expect_refused({.fixed_scales = {1.5}}, "fixed_scales[0] is 1.5");
  expect_refused({.fixed_threshold = -2}, "fixed_threshold[0] is -2, must be in [-1, 1]");
  expect_refused({.min_pixels = 0}, "min_pixels is 0");
}

}  // namespace
}  // namespace pepeseg
