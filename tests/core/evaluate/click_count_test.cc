#include "core/evaluate/click_count.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/core/evaluate/two_blobs.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

constexpr int kSize = testing::kTwoBlobsSize;
constexpr uint16_t kThing = 3;

absl::Status GoOn() { return absl::OkStatus(); }

// One entity in three views: the left blob, or both blobs.
class ClickCountTest : public ::testing::Test {
 protected:
  void MakeModel(float gate_bias, bool both) {
    ASSERT_OK_AND_ASSIGN(segmenter_, Segmenter::Create(*backend_, testing::TwoBlobs(gate_bias)));
    for (int v = 0; v < 3; ++v) {
      LabeledView& view = views_.emplace_back();
      view.view = segmenter_->model().views[v];
      view.labels.assign(size_t{kSize} * kSize, 0);
      for (const bool left : {true, false}) {
        if (!left && !both) continue;
        const std::vector<uint8_t> blob = testing::MaskOfBlob(*segmenter_, v, left);
        for (size_t i = 0; i < blob.size(); ++i) {
          if (blob[i] != 0) view.labels[i] = kThing;
        }
      }
    }
  }

  std::unique_ptr<Backend> backend_ = MakeCpuBackend(2);
  std::unique_ptr<Segmenter> segmenter_;
  std::vector<LabeledView> views_;
};

constexpr float kApart = 10,
                kTogether = 2;  // gate biases: the blobs are apart or together at most scales

TEST_F(ClickCountTest, CountsOneClickIfTheFirstAnswerIsRight) {
  MakeModel(kApart, /*both=*/false);
  ASSERT_OK_AND_ASSIGN(const ClickScores scores, EvaluateClicks(*segmenter_, views_, {}, GoOn));
  ASSERT_EQ(scores.entities.size(), 1u);
  const EntityClicks& score = scores.entities[0];
  EXPECT_EQ(score.id, kThing);
  EXPECT_TRUE(score.reached);
  EXPECT_EQ(score.num_clicks, 1);
  ASSERT_EQ(score.answers.size(), 1u);  // no wrong pixel is left to click
  EXPECT_TRUE(score.answers[0].click.positive);
  EXPECT_NEAR(score.answers[0].click.x, 32, 1);
  EXPECT_DOUBLE_EQ(score.answers[0].reference_iou, 1);
  EXPECT_DOUBLE_EQ(score.answers[0].iou, 1);
  EXPECT_EQ(score.iou_after, (std::array{1.0, 1.0, 1.0}));
  EXPECT_EQ(scores.num_clicks, 1);
  EXPECT_EQ(scores.reached, 1);
}

TEST_F(ClickCountTest, ClicksNegativelyOnASpilledBlob) {
  MakeModel(kTogether, /*both=*/false);
  ASSERT_OK_AND_ASSIGN(const ClickScores scores, EvaluateClicks(*segmenter_, views_, {}, GoOn));
  const EntityClicks& score = scores.entities[0];
  EXPECT_TRUE(score.reached);
  EXPECT_EQ(score.num_clicks, 2);
  ASSERT_GE(score.answers.size(), 2u);
  EXPECT_NEAR(score.answers[0].reference_iou, 0.5, 0.02);
  EXPECT_NEAR(score.answers[0].iou, 0.5, 0.02);
  EXPECT_FALSE(score.answers[1].click.positive);
  EXPECT_NEAR(score.answers[1].click.x, 64, 1);  // the middle of the right blob
  EXPECT_NEAR(score.answers[1].click.y, 48, 1);
  EXPECT_GT(score.answers[1].reference_iou, 0.95);
  EXPECT_GT(score.answers[1].iou, 0.95);
  EXPECT_EQ(score.iou_after[1], score.answers[1].iou);
}

TEST_F(ClickCountTest, ClicksPositivelyOnAMissedBlob) {
  MakeModel(kApart, /*both=*/true);
  ASSERT_OK_AND_ASSIGN(const ClickScores scores, EvaluateClicks(*segmenter_, views_, {}, GoOn));
  const EntityClicks& score = scores.entities[0];
  EXPECT_EQ(score.num_clicks, 2);
  ASSERT_GE(score.answers.size(), 2u);
  EXPECT_NEAR(score.answers[0].reference_iou, 0.5, 0.02);
  EXPECT_TRUE(score.answers[1].click.positive);
  EXPECT_NEAR(score.answers[0].click.x + score.answers[1].click.x, 96, 2);  // one on each
  EXPECT_GT(score.answers[1].iou, 0.95);
}

// The lower 30 rows belong to the entity, but nothing is rendered there.
TEST_F(ClickCountTest, CountsMaxClicksForAnEntityNeverReached) {
  MakeModel(kApart, /*both=*/false);
  for (LabeledView& view : views_) {
    std::fill(view.labels.end() - ptrdiff_t{30} * kSize, view.labels.end(), kThing);
  }
  ASSERT_OK_AND_ASSIGN(const ClickScores scores, EvaluateClicks(*segmenter_, views_, {}, GoOn));
  const EntityClicks& score = scores.entities[0];
  EXPECT_FALSE(score.reached);
  EXPECT_EQ(score.num_clicks, 20);
  ASSERT_EQ(score.answers.size(), 20u);
  EXPECT_TRUE(score.answers[0].on_nothing);  // the rows are deeper than the blob
  EXPECT_EQ(score.answers[0].reference_iou, 0);
  for (size_t i = 1; i < score.answers.size(); ++i) {
    for (size_t j = 0; j < i; ++j) {  // another pixel each time
      EXPECT_FALSE(score.answers[i].click.x == score.answers[j].click.x &&
                   score.answers[i].click.y == score.answers[j].click.y);
    }
  }
  EXPECT_EQ(scores.reached, 0);
  EXPECT_EQ(scores.num_clicks, 20);
  ASSERT_OK_AND_ASSIGN(const ClickScores three,
                       EvaluateClicks(*segmenter_, views_, {.max_clicks = 3}, GoOn));
  EXPECT_EQ(three.num_clicks, 3);
  EXPECT_EQ(three.entities[0].answers.size(), 3u);
}

TEST_F(ClickCountTest, NeitherClicksNorScoresIgnoredPixels) {
  MakeModel(kTogether, /*both=*/false);
  for (LabeledView& view : views_) {
    view.ignore.assign(view.labels.size(), 0);
    for (int i = 0; i < kSize * kSize; ++i) view.ignore[i] = i % kSize >= 48 ? 1 : 0;
  }
  ASSERT_OK_AND_ASSIGN(const ClickScores scores, EvaluateClicks(*segmenter_, views_, {}, GoOn));
  EXPECT_EQ(scores.num_clicks, 1);  // the right blob spills where nobody looks
  EXPECT_GT(scores.iou_after[0], 0.95);
}

TEST_F(ClickCountTest, ReturnsTheErrorOfCheckCancelled) {
  MakeModel(kTogether, /*both=*/false);
  for (const int allowed : {0, 1}) {
    int asked = 0;
    const auto scores = EvaluateClicks(*segmenter_, views_, {}, [&] {
      return asked++ < allowed ? absl::OkStatus() : absl::CancelledError("enough");
    });
    EXPECT_STATUS(scores, absl::StatusCode::kCancelled, "enough");
    EXPECT_EQ(asked, allowed + 1);
  }
}

TEST_F(ClickCountTest, RefusesOptionsOutOfRangeAndLabelsWithoutAnEntity) {
  const auto expect_refused = [](const ClickOptions& options, const std::string& message) {
    EXPECT_STATUS(Validate(options), absl::StatusCode::kInvalidArgument, message);
  };
  EXPECT_OK(Validate(ClickOptions()));
  expect_refused({.min_iou = 0}, "min_iou is 0, must be in (0, 1]");
  expect_refused({.max_clicks = 2}, "max_clicks is 2, must be in [3, 256]");
  expect_refused({.max_clicks = 257}, "max_clicks is 257");
  expect_refused({.min_pixels = 0}, "min_pixels is 0");
  MakeModel(kApart, /*both=*/false);
  EXPECT_STATUS(EvaluateClicks(*segmenter_, {views_.data(), 1}, {}, GoOn),
                absl::StatusCode::kInvalidArgument, "no entity shows at least 100 pixels");
}

}  // namespace
}  // namespace pepeseg
