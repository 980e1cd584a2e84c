#include "core/evaluate/proposal_scores.h"

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
class ProposalScoresTest : public ::testing::Test {
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

TEST_F(ProposalScoresTest, ChoosesAmongTheFirstThreeOnTheReference) {
  MakeModel(/*gate_bias=*/2, /*both=*/false);  // together at most scales
  ASSERT_OK_AND_ASSIGN(const ProposalScores scores,
                       EvaluateProposals(*segmenter_, views_, 100, GoOn));
  ASSERT_EQ(scores.entities.size(), 1u);
  const EntityProposals& score = scores.entities[0];
  EXPECT_EQ(score.id, kThing);
  EXPECT_NEAR(score.click.x, 32, 1);
  ASSERT_EQ(score.proposals.size(), 2u);  // both blobs, one blob
  EXPECT_GT(score.proposals[0].support, score.proposals[1].support);
  EXPECT_NEAR(score.proposals[0].reference_iou, 0.5, 0.02);
  EXPECT_DOUBLE_EQ(score.proposals[1].reference_iou, 1);
  EXPECT_EQ(score.first_iou, score.proposals[0].iou);
  EXPECT_NEAR(score.first_iou, 0.5, 0.02);
  EXPECT_DOUBLE_EQ(score.best_of_three_iou, 1);
  EXPECT_DOUBLE_EQ(score.best_iou, 1);
  EXPECT_DOUBLE_EQ(scores.first_iou, score.first_iou);
  EXPECT_DOUBLE_EQ(scores.best_of_three_iou, 1);
}

// Only the scored views label both blobs; the proposal must not be chosen on them.
TEST_F(ProposalScoresTest, DoesNotChooseOnTheScoredViews) {
  MakeModel(/*gate_bias=*/2, /*both=*/true);
  const std::vector<uint8_t> left = testing::MaskOfBlob(*segmenter_, 0, true);
  for (size_t i = 0; i < left.size(); ++i) views_[0].labels[i] = left[i] != 0 ? kThing : 0;
  ASSERT_OK_AND_ASSIGN(const ProposalScores scores,
                       EvaluateProposals(*segmenter_, views_, 100, GoOn));
  EXPECT_DOUBLE_EQ(scores.first_iou, 1);
  EXPECT_NEAR(scores.best_of_three_iou, 0.5, 0.02);
}

TEST_F(ProposalScoresTest, ScoresZeroForAClickOnNothing) {
  MakeModel(/*gate_bias=*/10, /*both=*/false);
  for (LabeledView& view : views_) {
    std::fill(view.labels.end() - ptrdiff_t{2} * kSize, view.labels.end(), 8);
  }
  ASSERT_OK_AND_ASSIGN(const ProposalScores scores,
                       EvaluateProposals(*segmenter_, views_, 100, GoOn));
  ASSERT_EQ(scores.entities.size(), 2u);
  EXPECT_TRUE(scores.entities[1].proposals.empty());
  EXPECT_EQ(scores.entities[1].best_iou, 0);
  EXPECT_DOUBLE_EQ(scores.first_iou, 0.5);
  EXPECT_DOUBLE_EQ(scores.best_of_three_iou, 0.5);
}

TEST_F(ProposalScoresTest, ReturnsTheErrorOfCheckCancelled) {
  MakeModel(/*gate_bias=*/10, /*both=*/false);
  EXPECT_STATUS(
      EvaluateProposals(*segmenter_, views_, 100, [] { return absl::CancelledError("enough"); }),
      absl::StatusCode::kCancelled, "enough");
}

}  // namespace
}  // namespace pepeseg
