#include <gtest/gtest.h>

#include "tests/server/shelf_model.h"

namespace pepeseg {
namespace {

struct ProposeScalesRpcTest : ShelfModel {
  Reply<v1::ProposeScalesResponse> Propose() const {
    return Call(&SegmentationStub::ProposeScales, request);
  }
  void ExpectRefused(grpc::StatusCode code, const std::string& words) const {
    EXPECT_ERROR(Propose(), code, {.message = words});
  }

  v1::ProposeScalesRequest request = Click<v1::ProposeScalesRequest>(30);
};

TEST_F(ProposeScalesRpcTest, MatchesSegmentAtItsScaleAndThreshold) {
  ASSERT_OK_AND_ASSIGN(auto answer, Propose());
  ASSERT_GE(answer.proposals_size(), 1);
  EXPECT_EQ(answer.model(), "scenes/shelf/models/1");
  const auto& best = answer.proposals(answer.best());
  EXPECT_GT(best.support(), 0.5);
  EXPECT_GT(best.stability(), 0.9);
  EXPECT_GT(best.scale_units(), 0);
  EXPECT_EQ(best.mask().view(), "middle.jpg");
  auto same = Click<v1::SegmentViewsRequest>(30);
  same.mutable_granularity()->set_scale_quantile(best.scale_quantile());
  same.mutable_granularity()->set_threshold(best.threshold());
  ASSERT_OK_AND_ASSIGN(const v1::SegmentViewsResponse segment,
                       Call(&SegmentationStub::SegmentViews, same));
  EXPECT_EQ(segment.masks(0).rle().counts(), best.mask().rle().counts());
}

TEST_F(ProposeScalesRpcTest, MatchesSegmentWithoutAGranularity) {
  ASSERT_OK_AND_ASSIGN(auto answer, Propose());
  ASSERT_GE(answer.proposals_size(), 1);
  ASSERT_OK_AND_ASSIGN(const v1::SegmentViewsResponse segment,
                       Call(&SegmentationStub::SegmentViews, Click<v1::SegmentViewsRequest>(30)));
  const auto& best = answer.proposals(answer.best());
  EXPECT_EQ(segment.scale_quantile(), best.scale_quantile());
  EXPECT_EQ(segment.threshold(), best.threshold());
  EXPECT_EQ(segment.masks(0).rle().counts(), best.mask().rle().counts());
}

TEST_F(ProposeScalesRpcTest, GrowsWithTheScale) {
  ASSERT_OK_AND_ASSIGN(auto answer, Propose());
  for (int i = 1; i < answer.proposals_size(); ++i) {
    const auto &small = answer.proposals(i - 1), &large = answer.proposals(i);
    EXPECT_GE(large.scale_quantile(), small.scale_quantile());
    EXPECT_GE(large.mask().area(), 1.5 * small.mask().area());
    EXPECT_GE(large.kind(), small.kind());
    EXPECT_NE(small.kind(), v1::ProposeScalesResponse::KIND_UNSPECIFIED);
  }
}

TEST_F(ProposeScalesRpcTest, ReturnsPngsUpToTheRequestedNumber) {
  request.set_mask_encoding(v1::MASK_ENCODING_PNG);
  request.set_max_proposals(1);
  ASSERT_OK_AND_ASSIGN(auto answer, Propose());
  ASSERT_EQ(answer.proposals_size(), 1);
  EXPECT_FALSE(answer.proposals(0).mask().png().empty());
}

TEST_F(ProposeScalesRpcTest, RefusesBadRequests) {
  request.set_max_proposals(17);
  ExpectRefused(grpc::INVALID_ARGUMENT, "max_proposals");
  request.set_max_proposals(-1);
  ExpectRefused(grpc::INVALID_ARGUMENT, "max_proposals");
  request.set_max_proposals(0);
  request.mutable_prompt()->mutable_points()->mutable_points(0)->set_x(-4);
  ExpectRefused(grpc::INVALID_ARGUMENT, "point -4,");
  request.mutable_prompt()->clear_points();
  ExpectRefused(grpc::INVALID_ARGUMENT, "no points");
  request.mutable_prompt()->mutable_view()->set_view("nowhere.jpg");
  ExpectRefused(grpc::INVALID_ARGUMENT, "nowhere.jpg");
  request.set_model("scenes/none/models/live");
  ExpectRefused(grpc::NOT_FOUND, "none");
}

}  // namespace
}  // namespace pepeseg
