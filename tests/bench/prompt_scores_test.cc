#include "tests/bench/prompt_scores.h"

#include <gtest/gtest.h>

#include "tests/core/evaluate/two_blobs.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

constexpr float kApart = 10, kTogether = 2;  // gate biases, at most scales

class PromptScoresTest : public testing::TwoBlobsTest {
 protected:
  void MakeTaskFor(float gate_bias) {
    MakeModel(gate_bias);
    ASSERT_OK_AND_ASSIGN(task_, MakeTask(Request(), {}));
  }
  absl::StatusOr<EntityProposals> Propose(size_t entity) const {
    return ScoreProposals(*segmenter_, task_, task_.entities[entity]);
  }

  EvaluationTask task_;
};

TEST_F(PromptScoresTest, ChoosesAmongTheFirstThreeProposalsOnTheReference) {
  for (int v = 0; v < 3; ++v) Show(v, "thing", Left(v));
  MakeTaskFor(kTogether);
  ASSERT_OK_AND_ASSIGN(const EntityProposals score, Propose(0));
  ASSERT_EQ(score.proposals.size(), 2u);  // both blobs, one blob
  EXPECT_GT(score.proposals[0].support, score.proposals[1].support);
  EXPECT_NEAR(score.proposals[0].reference_iou, 0.5, 0.02);
  EXPECT_DOUBLE_EQ(score.proposals[1].reference_iou, 1);
  EXPECT_EQ(score.first_iou, score.proposals[0].iou);
  EXPECT_NEAR(score.first_iou, 0.5, 0.02);
  EXPECT_DOUBLE_EQ(score.best_of_three_iou, 1);
  EXPECT_DOUBLE_EQ(score.best_iou, 1);
}

// Only the scored views label both blobs; the proposal must not be chosen on them.
TEST_F(PromptScoresTest, DoesNotChooseProposalsOnTheScoredViews) {
  Show(0, "thing", Left(0));
  for (const int v : {1, 2}) Show(v, "thing", Pair(v));
  MakeTaskFor(kTogether);
  ASSERT_OK_AND_ASSIGN(const EntityProposals score, Propose(0));
  EXPECT_DOUBLE_EQ(score.first_iou, 1);
  EXPECT_NEAR(score.best_of_three_iou, 0.5, 0.02);
}

TEST_F(PromptScoresTest, ScoresZeroForAClickOnNothing) {
  for (int v = 0; v < 3; ++v) Show(v, "rows", BottomRows(2));
  MakeTaskFor(kApart);
  ASSERT_OK_AND_ASSIGN(const EntityProposals score, Propose(0));
  EXPECT_TRUE(score.proposals.empty());
  EXPECT_EQ(score.first_iou, 0);
  EXPECT_EQ(score.best_iou, 0);
}

// The click on the left blob finds both, which are an entity at the other level.
TEST_F(PromptScoresTest, ComparesTheFirstProposalWithEveryLevel) {
  for (int v = 0; v < 3; ++v) Show(v, "pair", Pair(v));
  std::vector<std::vector<TruthView>> levels = {Request().views};
  masks_.clear();
  for (int v = 0; v < 3; ++v) Show(v, "left", Left(v));
  levels.push_back(Request().views);
  MakeTaskFor(kTogether);
  ASSERT_OK_AND_ASSIGN(const PromptScores scores, ScorePrompts(*segmenter_, task_, levels));
  EXPECT_NEAR(scores.first_iou, 0.5, 0.02);
  EXPECT_DOUBLE_EQ(scores.first_thing_iou, 1);
  EXPECT_GT(scores.mask_iou, 0.95);
  EXPECT_GT(scores.box_iou, 0.95);
  // Each Gaussian is in the selection or not, so that its image has no soft border.
  EXPECT_NEAR(scores.selection_iou, 0.742, 0.01);
}

}  // namespace
}  // namespace pepeseg
