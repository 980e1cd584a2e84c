#include "core/query/propose_scales.h"

#include <gtest/gtest.h>

#include "core/query/resolve_prompt.h"
#include "tests/testing/front_blobs.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

constexpr int kViewSize = 48;
constexpr double kLeftBlobX = 17.5, kRightBlobX = 30.5, kBlobY = 24.5;

class ProposeScalesTest : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_OK_AND_ASSIGN(segmenter_, Segmenter::Create(*backend_, testing::PairOfBlobs(kViewSize)));
    view_ = segmenter_->model().views[0];
    points_ = {{kLeftBlobX, kBlobY, true}};
  }
  absl::StatusOr<ScaleProposals> Propose(int max_count = kDefaultProposals) const {
    return ProposeScales(*segmenter_, view_, points_, {max_count});
  }
  static bool Shows(const SegmentResult& result, double x) {
    return result.mask.pixels[static_cast<size_t>(kBlobY) * kViewSize + static_cast<size_t>(x)] !=
           0;
  }

  std::unique_ptr<Backend> backend_ = MakeCpuBackend(2);
  std::unique_ptr<Segmenter> segmenter_;
  ModelView view_;
  std::vector<PointPrompt> points_;
};

TEST_F(ProposeScalesTest, FindsTheBlobAndThenBothBlobs) {
  ASSERT_OK_AND_ASSIGN(const ScaleProposals proposals, Propose());
  ASSERT_EQ(proposals.ladder.size(), 2u);
  const ScaleProposal &one = proposals.ladder[0], &both = proposals.ladder[1];
  EXPECT_TRUE(Shows(one.result, kLeftBlobX) && !Shows(one.result, kRightBlobX));
  EXPECT_TRUE(Shows(both.result, kLeftBlobX) && Shows(both.result, kRightBlobX));
  EXPECT_LT(one.result.scale, both.result.scale);
  EXPECT_GE(proposals.ladder[proposals.best].support, one.support);
  EXPECT_GE(proposals.ladder[proposals.best].support, both.support);
  for (const ScaleProposal& proposal : proposals.ladder) {
    EXPECT_GT(proposal.stability, 0.9);
    EXPECT_GT(proposal.result.scale_units, 0);
    EXPECT_NE(proposal.kind, ProposalKind::kUnnamed);
  }
}

TEST_F(ProposeScalesTest, LeavesOutWhatANegativePointHits) {
  points_.push_back({kRightBlobX, kBlobY, false});
  ASSERT_OK_AND_ASSIGN(const ScaleProposals proposals, Propose());
  ASSERT_FALSE(proposals.ladder.empty());
  for (const ScaleProposal& proposal : proposals.ladder)
    EXPECT_FALSE(Shows(proposal.result, kRightBlobX));
}

TEST_F(ProposeScalesTest, ReturnsTheMasksThatSegmentReturns) {
  for (const bool refine_borders : {false, true}) {
    const SegmentOptions options = {.refine_borders = refine_borders};
    ASSERT_OK_AND_ASSIGN(const ScaleProposals proposals,
                         ProposeScales(*segmenter_, view_, points_, {.segment = options}));
    ASSERT_FALSE(proposals.ladder.empty());
    for (const ScaleProposal& proposal : proposals.ladder) {
      const Granularity at = {proposal.result.scale, proposal.result.threshold};
      ASSERT_OK_AND_ASSIGN(const Query query, ResolvePrompt(*segmenter_, {view_, points_}, at));
      ASSERT_OK_AND_ASSIGN(const auto want, segmenter_->Segment(query, {&view_, 1}, options));
      EXPECT_EQ(proposal.result.mask.pixels, want[0].mask.pixels);
    }
  }
}

TEST_F(ProposeScalesTest, ReturnsAtMostMaxCount) {
  ASSERT_OK_AND_ASSIGN(const ScaleProposals all, Propose());
  ASSERT_OK_AND_ASSIGN(const ScaleProposals one, Propose(1));
  ASSERT_EQ(one.ladder.size(), 1u);
  EXPECT_EQ(one.ladder[0].result.scale, all.ladder[all.best].result.scale);
  EXPECT_EQ(one.ladder[0].kind, ProposalKind::kUnnamed);
  EXPECT_STATUS(Propose(0), absl::StatusCode::kInvalidArgument, "0 proposals");
}

TEST_F(ProposeScalesTest, RefusesInvalidPrompts) {
  points_ = {{-1, 3, true}};
  EXPECT_STATUS(Propose(), absl::StatusCode::kInvalidArgument, "point 0 is at (-1, 3)");
  points_ = {};
  EXPECT_STATUS(Propose(), absl::StatusCode::kInvalidArgument, "no positive point");
  points_ = {{2, 3, true}};
  EXPECT_STATUS(Propose(), absl::StatusCode::kInvalidArgument, "nothing with a feature");
}

TEST(KindsOfLadder, NamesOnlyProposalsThatNest) {
  constexpr auto kPart = ProposalKind::kPart, kObject = ProposalKind::kObject,
                 kGroup = ProposalKind::kGroup;
  using Kinds = std::vector<ProposalKind>;
  EXPECT_EQ(KindsOfLadder(0, 0), Kinds());
  EXPECT_EQ(KindsOfLadder(1, 0), Kinds({ProposalKind::kUnnamed}));
  EXPECT_EQ(KindsOfLadder(2, 1), Kinds({kPart, kObject}));
  EXPECT_EQ(KindsOfLadder(2, 0), Kinds({kObject, kGroup}));
  for (const int best : {0, 1, 2}) {
    EXPECT_EQ(KindsOfLadder(3, best), Kinds({kPart, kObject, kGroup}));
  }
  EXPECT_EQ(KindsOfLadder(5, 3), Kinds({kPart, kPart, kPart, kObject, kGroup}));
}

}  // namespace
}  // namespace pepeseg
