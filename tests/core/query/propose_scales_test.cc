#include "core/query/propose_scales.h"

#include <gtest/gtest.h>

#include "tests/core/query/front_blobs.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

constexpr int kSize = 48;
constexpr double kLeftX = 17.5, kRightX = 30.5, kY = 24.5;

class ProposeScalesTest : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_OK_AND_ASSIGN(segmenter_, Segmenter::Create(*backend_, testing::PairOfBlobs(kSize)));
    view_ = segmenter_->model().views[0];
    points_ = {{kLeftX, kY, true}};
  }
  absl::StatusOr<std::vector<ScaleProposal>> Propose(int max_count = kDefaultProposals) const {
    return ProposeScales(*segmenter_, view_, points_, max_count);
  }
  static bool Shows(const SegmentResult& result, double x) {
    return result.mask.pixels[static_cast<size_t>(kY) * kSize + static_cast<size_t>(x)] != 0;
  }

  std::unique_ptr<Backend> backend_ = MakeCpuBackend(2);
  std::unique_ptr<Segmenter> segmenter_;
  ModelView view_;
  std::vector<PointPrompt> points_;
};

TEST_F(ProposeScalesTest, FindsTheBlobAndBothBlobs) {
  ASSERT_OK_AND_ASSIGN(const auto proposals, Propose());
  ASSERT_EQ(proposals.size(), 2u);
  EXPECT_GE(proposals[0].support, proposals[1].support);
  const bool first_is_one = !Shows(proposals[0].result, kRightX);
  const ScaleProposal &one = proposals[first_is_one ? 0 : 1],
                      &both = proposals[first_is_one ? 1 : 0];
  EXPECT_TRUE(Shows(one.result, kLeftX) && !Shows(one.result, kRightX));
  EXPECT_TRUE(Shows(both.result, kLeftX) && Shows(both.result, kRightX));
  EXPECT_LT(one.result.scale, both.result.scale);
  for (const ScaleProposal& proposal : proposals) {
    EXPECT_GT(proposal.stability, 0.9);
    EXPECT_GT(proposal.result.scale_units, 0);
  }
}

TEST_F(ProposeScalesTest, ANegativePointLeavesTheOther) {
  points_.push_back({kRightX, kY, false});
  ASSERT_OK_AND_ASSIGN(const auto proposals, Propose());
  ASSERT_FALSE(proposals.empty());
  for (const ScaleProposal& proposal : proposals) EXPECT_FALSE(Shows(proposal.result, kRightX));
}

TEST_F(ProposeScalesTest, AtMostAsManyAsAskedFor) {
  ASSERT_OK_AND_ASSIGN(const auto proposals, Propose(1));
  EXPECT_EQ(proposals.size(), 1u);
  EXPECT_STATUS(Propose(0), absl::StatusCode::kInvalidArgument, "0 proposals");
}

TEST_F(ProposeScalesTest, BadPromptsAreRefused) {
  points_ = {{-1, 3, true}};
  EXPECT_STATUS(Propose(), absl::StatusCode::kInvalidArgument, "point 0 is at (-1, 3)");
  points_ = {};
  EXPECT_STATUS(Propose(), absl::StatusCode::kInvalidArgument, "no positive point");
  points_ = {{2, 3, true}};
  EXPECT_STATUS(Propose(), absl::StatusCode::kInvalidArgument, "nothing with a feature");
}

}  // namespace
}  // namespace pepeseg
