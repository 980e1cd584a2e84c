#include <gtest/gtest.h>

#include <thread>

#include "tests/server/shelf_model.h"

namespace pepeseg {
namespace {

struct SegmentStreamTest : ShelfModel {
  using Stream = grpc::ClientReaderWriter<v1::StreamSegmentsRequest, v1::StreamSegmentsResponse>;

  static v1::StreamSegmentsRequest Click(int64_t sequence, double x) {
    v1::StreamSegmentsRequest request;
    request.set_sequence(sequence);
    request.mutable_segment()->set_model(kModel);
    v1::Prompt& prompt = *request.mutable_segment()->mutable_prompt();
    prompt.mutable_view()->set_view("middle.jpg");
    auto* point = prompt.mutable_points()->add_points();
    point->set_x(x);
    point->set_y(32);
    v1::Granularity& granularity = *request.mutable_segment()->mutable_granularity();
    granularity.set_scale_quantile(0.5);
    granularity.set_threshold(0.75);
    return request;
  }
  std::unique_ptr<Stream> Open() { return running.segmentation->StreamSegments(&context); }

  grpc::ClientContext context;
};

TEST_F(SegmentStreamTest, AnswersWhileThePointIsDragged) {
  const auto stream = Open();
  v1::StreamSegmentsResponse answer;
  for (const auto& [sequence, x, left] :
       {std::tuple(1, 30.0, true), {2, 31.0, true}, {5, 66.0, false}}) {
    ASSERT_TRUE(stream->Write(Click(sequence, x)));
    ASSERT_TRUE(stream->Read(&answer));
    EXPECT_EQ(answer.sequence(), sequence);
    ASSERT_TRUE(answer.has_segment()) << answer.DebugString();
    EXPECT_EQ(answer.segment().masks(0).box().x() < 48, left);
  }
  EXPECT_TRUE(stream->WritesDone());
  EXPECT_FALSE(stream->Read(&answer));
  EXPECT_OK(stream->Finish());
}

TEST_F(SegmentStreamTest, ContinuesAfterARefusedRequest) {
  const auto stream = Open();
  v1::StreamSegmentsResponse answer;
  ASSERT_TRUE(stream->Write(Click(1, 200)));
  ASSERT_TRUE(stream->Read(&answer));
  EXPECT_EQ(answer.sequence(), 1);
  ASSERT_TRUE(answer.has_error());
  EXPECT_EQ(answer.error().code(), grpc::INVALID_ARGUMENT);
  EXPECT_NE(answer.error().message().find("point 200,32 is outside"), std::string::npos);
  EXPECT_EQ(answer.error().reason(), "BAD_FIELD");
  EXPECT_EQ(answer.error().field(), "prompt.points.points[0]");
  EXPECT_EQ(answer.error().value(), "point 200,32");
  ASSERT_TRUE(stream->Write(Click(2, 30)));
  ASSERT_TRUE(stream->Read(&answer));
  EXPECT_TRUE(answer.has_segment());
  stream->WritesDone();
  EXPECT_OK(stream->Finish());
}

TEST_F(SegmentStreamTest, AnswersOnlyTheNewestWaitingRequest) {
  // Keep the threads of the queries busy while the requests come.
  std::vector<std::thread> others;
  for (int i = 0; i < 4; ++i) {
    others.emplace_back([this] {
      v1::ProposeScalesRequest request;
      request.set_model(kModel);
      v1::Prompt& prompt = *request.mutable_prompt();
      v1::PinholeCamera& camera = *prompt.mutable_view()->mutable_free()->mutable_camera();
      camera.set_width(960), camera.set_height(640);
      camera.set_fx(600), camera.set_fy(600), camera.set_cx(480), camera.set_cy(320);
      v1::RigidTransform& pose = *prompt.mutable_view()->mutable_free()->mutable_cam_from_world();
      pose.mutable_rotation()->set_w(1);
      pose.mutable_translation();
      prompt.mutable_points()->add_points()->set_x(300);
      prompt.mutable_points()->mutable_points(0)->set_y(320);
      EXPECT_OK(Call(&SegmentationStub::ProposeScales, request));
    });
  }
  const auto stream = Open();
  constexpr int kNumRequests = 40;
  for (int i = 1; i <= kNumRequests; ++i) ASSERT_TRUE(stream->Write(Click(i, 30)));
  stream->WritesDone();
  std::vector<int64_t> answered;
  for (v1::StreamSegmentsResponse answer; stream->Read(&answer);) {
    EXPECT_TRUE(answer.has_segment()) << answer.DebugString();
    answered.push_back(answer.sequence());
  }
  EXPECT_OK(stream->Finish());
  for (std::thread& other : others) other.join();
  ASSERT_FALSE(answered.empty());
  EXPECT_EQ(answered.back(), kNumRequests);
  EXPECT_LT(answered.size(), size_t{kNumRequests} / 2);
  EXPECT_TRUE(std::is_sorted(answered.begin(), answered.end()));
}

TEST_F(SegmentStreamTest, EndsWhenTheClientIsGone) {
  {
    const auto stream = Open();
    ASSERT_TRUE(stream->Write(Click(1, 30)));
    context.TryCancel();
    EXPECT_ERROR(stream->Finish(), grpc::CANCELLED);
  }
  running.server->Shutdown(absl::Now() + absl::Seconds(10));  // waits for what is left
}

}  // namespace
}  // namespace pepeseg
