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
  grpc::Status Render(v1::RenderRequest::Content content) {
    grpc::ClientContext context;
    v1::RenderRequest request;
    request.set_model(kBare);
    request.set_content(content);
    request.mutable_viewpoint()->set_view("middle.jpg");
    v1::RenderResponse response;
    const grpc::Status status = running.segmentation->Render(&context, request, &response);
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
  EXPECT_TRUE(Render(v1::RenderRequest::CONTENT_COLOR).ok());
  EXPECT_TRUE(Render(v1::RenderRequest::CONTENT_DEPTH).ok());
}

TEST_F(ModelWithoutFeatures, ExplainsWhyThereAreNoSegments) {
  ExpectNoFeatures(Render(v1::RenderRequest::CONTENT_SEGMENTS));
  ExpectNoFeatures(Render(v1::RenderRequest::CONTENT_FEATURES));
  grpc::ClientContext context;
  v1::SegmentRequest click;
  click.set_model(kBare);
  click.mutable_prompt()->mutable_view()->set_view("middle.jpg");
  click.mutable_prompt()->mutable_points()->add_points()->set_x(30);
  v1::SegmentResponse answer;
  ExpectNoFeatures(running.segmentation->Segment(&context, click, &answer));
  grpc::ClientContext other;
  v1::DecomposeRequest whole;
  whole.set_model(kBare);
  v1::DecomposeResponse parts;
  ExpectNoFeatures(running.segmentation->Decompose(&other, whole, &parts));
}

}  // namespace
}  // namespace pepeseg
