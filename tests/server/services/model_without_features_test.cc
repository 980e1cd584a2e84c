// A model that was trained without masks: it can be rendered, and segmenting it explains why not.
#include <gtest/gtest.h>

#include <string>

#include "tests/server/running_server.h"

namespace pepeseg {
namespace {

constexpr char kBare[] = "scenes/bare/models/live";

struct ModelWithoutFeatures : ::testing::Test {
  ModelWithoutFeatures() : running(PEPESEG_MODEL_WORKER) {
    running.CreateScene("bare");
    const v1::Job job = running.Await(running.Train("bare", "bare").name());
    EXPECT_EQ(job.state(), v1::JOB_STATE_SUCCEEDED) << job.DebugString();
  }
  static void ExpectNoFeatures(const grpc::Status& status) {
    EXPECT_EQ(status.error_code(), grpc::FAILED_PRECONDITION) << status.error_message();
    EXPECT_EQ(DetailOf(status).reason(), "NO_FEATURES");
    EXPECT_EQ(DetailOf(status).resource(), "scenes/bare/models/1");
  }
  grpc::Status Render(v1::RenderViewRequest::Content content) {
    grpc::ClientContext context;
    v1::RenderViewRequest request;
    request.set_model(kBare);
    request.set_content(content);
    request.mutable_viewpoint()->set_view("middle.jpg");
    v1::RenderViewResponse response;
    const grpc::Status status = running.renders->RenderView(&context, request, &response);
    EXPECT_EQ(status.ok(), !response.png().empty());
    return status;
  }

  RunningServer running;
};

TEST_F(ModelWithoutFeatures, HasViewsAndPictures) {
  grpc::ClientContext context;
  v1::ListViewsRequest request;
  request.set_parent(kBare);
  v1::ListViewsResponse views;
  const grpc::Status status = running.scenes->ListViews(&context, request, &views);
  ASSERT_TRUE(status.ok()) << status.error_message();
  EXPECT_EQ(views.views_size(), 3);
  EXPECT_TRUE(Render(v1::RenderViewRequest::CONTENT_COLOR).ok());
  EXPECT_TRUE(Render(v1::RenderViewRequest::CONTENT_DEPTH).ok());
}

TEST_F(ModelWithoutFeatures, ExplainsWhyThereAreNoSegments) {
  ExpectNoFeatures(Render(v1::RenderViewRequest::CONTENT_SEGMENTS));
  ExpectNoFeatures(Render(v1::RenderViewRequest::CONTENT_FEATURES));
  grpc::ClientContext context;
  v1::SegmentViewsRequest click;
  click.set_model(kBare);
  click.mutable_prompt()->mutable_view()->set_view("middle.jpg");
  click.mutable_prompt()->mutable_points()->add_points()->set_x(30);
  v1::SegmentViewsResponse answer;
  ExpectNoFeatures(running.segmentation->SegmentViews(&context, click, &answer));
  grpc::ClientContext other;
  v1::DecomposeModelRequest whole;
  whole.set_model(kBare);
  v1::DecomposeModelResponse parts;
  ExpectNoFeatures(running.segmentation->DecomposeModel(&other, whole, &parts));
}

}  // namespace
}  // namespace pepeseg
