#include <gtest/gtest.h>

#include "tests/server/running_server.h"

namespace pepeseg {
namespace {

// A scene with the model of model_worker.cc: a red and a blue square.
struct ProposeScalesRpcTest : ::testing::Test {
  ProposeScalesRpcTest() : running(PEPESEG_MODEL_WORKER) {
    running.CreateScene("shelf");
    const v1::Job job = running.Await(running.Train("shelf", "file").name());
    EXPECT_EQ(job.state(), v1::JOB_STATE_SUCCEEDED) << job.DebugString();
    request.set_model("scenes/shelf/models/live");
    request.mutable_prompt()->mutable_view()->set_view("middle.jpg");
    auto* point = request.mutable_prompt()->mutable_points()->add_points();
    point->set_x(30);
    point->set_y(32);
  }
  grpc::Status Propose() {
    grpc::ClientContext context;
    answer.Clear();
    return running.segmentation->ProposeScales(&context, request, &answer);
  }
  void ExpectRefused(grpc::StatusCode code, const std::string& words) {
    const grpc::Status status = Propose();
    EXPECT_EQ(status.error_code(), code) << words;
    EXPECT_NE(status.error_message().find(words), std::string::npos) << status.error_message();
  }

  RunningServer running;
  v1::ProposeScalesRequest request;
  v1::ProposeScalesResponse answer;
};

TEST_F(ProposeScalesRpcTest, MatchesSegmentAtItsScaleAndThreshold) {
  const grpc::Status status = Propose();
  ASSERT_TRUE(status.ok()) << status.error_message();
  ASSERT_GE(answer.proposals_size(), 1);
  EXPECT_EQ(answer.model(), "scenes/shelf/models/1");
  const auto& best = answer.proposals(answer.best());
  EXPECT_GT(best.support(), 0.5);
  EXPECT_GT(best.stability(), 0.9);
  EXPECT_GT(best.scale_units(), 0);
  EXPECT_EQ(best.mask().view(), "middle.jpg");
  v1::SegmentViewsRequest same;
  same.set_model(request.model());
  *same.mutable_prompt() = request.prompt();
  same.mutable_granularity()->set_scale_quantile(best.scale_quantile());
  same.mutable_granularity()->set_threshold(best.threshold());
  v1::SegmentViewsResponse segment;
  grpc::ClientContext context;
  ASSERT_TRUE(running.segmentation->SegmentViews(&context, same, &segment).ok());
  EXPECT_EQ(segment.masks(0).rle().counts(), best.mask().rle().counts());
}

TEST_F(ProposeScalesRpcTest, MatchesSegmentWithoutAGranularity) {
  ASSERT_TRUE(Propose().ok());
  ASSERT_GE(answer.proposals_size(), 1);
  v1::SegmentViewsRequest plain;
  plain.set_model(request.model());
  *plain.mutable_prompt() = request.prompt();
  v1::SegmentViewsResponse segment;
  grpc::ClientContext context;
  ASSERT_TRUE(running.segmentation->SegmentViews(&context, plain, &segment).ok());
  const auto& best = answer.proposals(answer.best());
  EXPECT_EQ(segment.scale_quantile(), best.scale_quantile());
  EXPECT_EQ(segment.threshold(), best.threshold());
  EXPECT_EQ(segment.masks(0).rle().counts(), best.mask().rle().counts());
}

TEST_F(ProposeScalesRpcTest, GrowsWithTheScale) {
  ASSERT_TRUE(Propose().ok());
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
  ASSERT_TRUE(Propose().ok());
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
