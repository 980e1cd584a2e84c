#include "core/evaluate/click_count.h"

#include <gtest/gtest.h>

#include "tests/core/evaluate/two_blobs.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using testing::kTwoBlobsSize;

// One entity in three views: the left blob, or both blobs.
class ClickCountTest : public testing::TwoBlobsTest {
 protected:
  void MakeScene(float gate_bias, bool both) {
    options_.protocol = Protocol::kClicks;
    options_.clicks.max_clicks = 20;
    for (int v = 0; v < 3; ++v) Show(v, "thing", both ? Pair(v) : Left(v));
    MakeModel(gate_bias);
  }
};

// Gate biases: the blobs are apart or together at most scales.
constexpr float kApart = 10, kTogether = 2;

TEST_F(ClickCountTest, CountsOneClickIfTheFirstAnswerIsRight) {
  MakeScene(kApart, /*both=*/false);
  ASSERT_OK_AND_ASSIGN(const EvaluationResult result, Run());
  ASSERT_EQ(result.entities.size(), 1u);
  const EntityClicks& score = result.entities[0].clicks.value();
  EXPECT_TRUE(score.reached);
  EXPECT_EQ(score.num_clicks, 1);
  ASSERT_EQ(score.answers.size(), 1u);  // no wrong pixel is left to click
  EXPECT_TRUE(score.answers[0].click.positive);
  EXPECT_NEAR(score.answers[0].click.x, 32, 1);
  EXPECT_DOUBLE_EQ(score.answers[0].reference_iou, 1);
  EXPECT_DOUBLE_EQ(score.answers[0].iou, 1);
  EXPECT_EQ(score.iou_after, (std::array{1.0, 1.0, 1.0}));
  EXPECT_EQ(result.scene.num_clicks, 1);
  EXPECT_EQ(result.scene.reached, 1);
}

TEST_F(ClickCountTest, ClicksNegativelyOnASpilledBlob) {
  MakeScene(kTogether, /*both=*/false);
  ASSERT_OK_AND_ASSIGN(const EvaluationResult result, Run());
  const EntityClicks& score = result.entities[0].clicks.value();
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
  EXPECT_EQ(result.scene.num_clicks, 2);
  EXPECT_EQ(result.scene.reached, 1);
  EXPECT_EQ(result.scene.iou_after, score.iou_after);
  EXPECT_EQ(result.categories[0].num_clicks, 2);
}

TEST_F(ClickCountTest, ClicksPositivelyOnAMissedBlob) {
  MakeScene(kApart, /*both=*/true);
  ASSERT_OK_AND_ASSIGN(const EvaluationResult result, Run());
  const EntityClicks& score = result.entities[0].clicks.value();
  EXPECT_EQ(score.num_clicks, 2);
  ASSERT_GE(score.answers.size(), 2u);
  EXPECT_NEAR(score.answers[0].reference_iou, 0.5, 0.02);
  EXPECT_TRUE(score.answers[1].click.positive);
  EXPECT_NEAR(score.answers[0].click.x + score.answers[1].click.x, 96, 2);  // one on each
  EXPECT_GT(score.answers[1].iou, 0.95);
}

// The lower 30 rows belong to the entity, but nothing is rendered there.
TEST_F(ClickCountTest, CountsMaxClicksForAnEntityNeverReached) {
  MakeScene(kApart, /*both=*/false);
  for (int v = 0; v < 3; ++v) Show(v, "thing", Union(Left(v), BottomRows(30)));
  ASSERT_OK_AND_ASSIGN(const EvaluationResult result, Run());
  const EntityClicks& score = result.entities[0].clicks.value();
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
  EXPECT_EQ(result.scene.reached, 0);
  EXPECT_EQ(result.scene.num_clicks, 20);
  options_.clicks.max_clicks = 3;
  ASSERT_OK_AND_ASSIGN(const EvaluationResult three, Run());
  EXPECT_EQ(three.scene.num_clicks, 3);
  EXPECT_EQ(three.entities[0].clicks->answers.size(), 3u);
}

TEST_F(ClickCountTest, NeitherClicksNorScoresIgnoredPixels) {
  MakeScene(kTogether, /*both=*/false);
  ignore_.resize(size_t{kTwoBlobsSize} * kTwoBlobsSize);
  for (int i = 0; i < kTwoBlobsSize * kTwoBlobsSize; ++i)
    ignore_[i] = i % kTwoBlobsSize >= 48 ? 1 : 0;
  ASSERT_OK_AND_ASSIGN(const EvaluationResult result, Run());
  EXPECT_EQ(result.scene.num_clicks, 1);  // the right blob spills where nobody looks
  EXPECT_GT(result.scene.iou_after[0], 0.95);
}

TEST_F(ClickCountTest, ReturnsTheErrorOfCheckCancelled) {
  MakeScene(kTogether, /*both=*/false);
  for (const int allowed : {0, 1}) {
    int asked = 0;
    const auto result = Evaluate(*segmenter_, Request(), options_, [&] {
      return asked++ < allowed ? absl::OkStatus() : absl::CancelledError("enough");
    });
    EXPECT_STATUS(result, absl::StatusCode::kCancelled, "enough");
    EXPECT_EQ(asked, allowed + 1);
  }
}

TEST_F(ClickCountTest, RefusesOtherPrompts) {
  MakeScene(kApart, /*both=*/false);
  prompts_ = {{"thing", "a", OwnMask{}}};
  EXPECT_STATUS(Run(), absl::StatusCode::kInvalidArgument,
                "entity \"thing\", reference view \"a\": the protocol \"clicks\" makes its own "
                "prompt");
}

TEST(ClickOptions, RefusesValuesOutOfRange) {
  const auto expect_refused = [](const ClickOptions& options, const std::string& message) {
    EXPECT_STATUS(Validate(options), absl::StatusCode::kInvalidArgument, message);
  };
  EXPECT_OK(Validate(ClickOptions()));
  expect_refused({.min_iou = 0}, "min_iou is 0, must be in (0, 1]");
  expect_refused({.max_clicks = 2}, "max_clicks is 2, must be in [3, 256]");
  expect_refused({.max_clicks = 257}, "max_clicks is 257");
}

}  // namespace
}  // namespace pepeseg
