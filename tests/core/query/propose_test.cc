#include "core/query/propose.h"

#include <gtest/gtest.h>

#include "core/query/resolve_prompt.h"
#include "tests/testing/front_blobs.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

constexpr int kViewSize = 48;
constexpr double kLeftBlobX = 17.5, kRightBlobX = 30.5, kBlobY = 24.5;

class ProposeTest : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_OK_AND_ASSIGN(segmenter_, Segmenter::Create(*backend_, testing::PairOfBlobs(kViewSize)));
    view_ = segmenter_->model().views[0];
    points_ = {{kLeftBlobX, kBlobY, true}};
  }
  absl::StatusOr<Proposals> Propose(int max_count = kDefaultProposals) const {
    return pepeseg::Propose(*segmenter_, {.prompt = {view_, points_}, .max_count = max_count});
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

TEST_F(ProposeTest, FindsTheBlobAndThenBothBlobs) {
  ASSERT_OK_AND_ASSIGN(const Proposals proposals, Propose());
  ASSERT_EQ(proposals.masks.size(), 2u);
  ASSERT_EQ(proposals.candidates.list.size(), 2u);
  const SegmentResult &one = proposals.masks[0], &both = proposals.masks[1];
  EXPECT_TRUE(Shows(one, kLeftBlobX) && !Shows(one, kRightBlobX));
  EXPECT_TRUE(Shows(both, kLeftBlobX) && Shows(both, kRightBlobX));
  EXPECT_LT(one.scale, both.scale);
  const std::vector<Candidate>& list = proposals.candidates.list;
  for (size_t i = 0; i < list.size(); ++i) {
    EXPECT_GE(list[proposals.candidates.best].support, list[i].support);
    EXPECT_GT(list[i].stability, 0.9);
    EXPECT_EQ(list[i].scale, proposals.masks[i].scale);
    EXPECT_EQ(list[i].threshold, proposals.masks[i].threshold);
    EXPECT_GT(proposals.masks[i].scale_units, 0);
  }
}

TEST_F(ProposeTest, LeavesOutWhatANegativePointHits) {
  points_.push_back({kRightBlobX, kBlobY, false});
  ASSERT_OK_AND_ASSIGN(const Proposals proposals, Propose());
  ASSERT_FALSE(proposals.masks.empty());
  for (const SegmentResult& mask : proposals.masks) EXPECT_FALSE(Shows(mask, kRightBlobX));
}

TEST_F(ProposeTest, ReturnsTheMasksThatSegmentReturns) {
  for (const bool refine_borders : {false, true}) {
    const SegmentOptions options = {.refine_borders = refine_borders};
    ASSERT_OK_AND_ASSIGN(
        const Proposals proposals,
        pepeseg::Propose(*segmenter_, {.prompt = {view_, points_}, .options = options}));
    ASSERT_FALSE(proposals.masks.empty());
    for (const SegmentResult& mask : proposals.masks) {
      const Granularity at = {mask.scale, mask.threshold};
      ASSERT_OK_AND_ASSIGN(const Query query, ResolvePrompt(*segmenter_, {view_, points_}, at));
      ASSERT_OK_AND_ASSIGN(const auto want, segmenter_->Segment(query, {&view_, 1}, options));
      EXPECT_EQ(mask.mask.pixels, want[0].mask.pixels);
    }
  }
}

TEST_F(ProposeTest, ReturnsAtMostMaxCount) {
  ASSERT_OK_AND_ASSIGN(const Proposals all, Propose());
  ASSERT_OK_AND_ASSIGN(const Proposals one, Propose(1));
  ASSERT_EQ(one.masks.size(), 1u);
  EXPECT_EQ(one.masks[0].scale, all.candidates.list[all.candidates.best].scale);
  EXPECT_STATUS(Propose(0), absl::StatusCode::kInvalidArgument, "0 proposals");
}

TEST_F(ProposeTest, RefusesPromptsThatSayHowLargeTheObjectIs) {
  for (const Shape& shape : {Shape(BoxPrompt{2, 2, 20, 20}), Shape(BinaryMask())}) {
    EXPECT_STATUS(pepeseg::Propose(*segmenter_, {.prompt = {view_, shape}}),
                  absl::StatusCode::kInvalidArgument, "only points");
  }
}

TEST_F(ProposeTest, RefusesInvalidPrompts) {
  points_ = {{-1, 3, true}};
  EXPECT_STATUS(Propose(), absl::StatusCode::kInvalidArgument, "point -1,3 is outside");
  points_ = {};
  EXPECT_STATUS(Propose(), absl::StatusCode::kInvalidArgument, "no positive point");
  points_ = {{2, 3, true}};
  EXPECT_STATUS(Propose(), absl::StatusCode::kInvalidArgument, "nothing with a feature");
}

TEST(KindOf, NamesOnlyProposalsThatNest) {
  constexpr auto kPart = ProposalKind::kPart, kObject = ProposalKind::kObject,
                 kGroup = ProposalKind::kGroup;
  using Kinds = std::vector<ProposalKind>;
  const auto kinds = [](int count, int best) {
    Kinds named;
    for (int i = 0; i < count; ++i) named.push_back(KindOf(i, count, best));
    return named;
  };
  EXPECT_EQ(kinds(1, 0), Kinds({ProposalKind::kUnnamed}));
  EXPECT_EQ(kinds(2, 1), Kinds({kPart, kObject}));
  EXPECT_EQ(kinds(2, 0), Kinds({kObject, kGroup}));
  for (const int best : {0, 1, 2}) EXPECT_EQ(kinds(3, best), Kinds({kPart, kObject, kGroup}));
  EXPECT_EQ(kinds(5, 3), Kinds({kPart, kPart, kPart, kObject, kGroup}));
}

}  // namespace
}  // namespace pepeseg
