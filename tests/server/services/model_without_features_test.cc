// A model that was trained without masks: it can be rendered, and segmenting it explains why not.
#include <gtest/gtest.h>

#include <string>

#include "tests/server/shelf_model.h"

namespace pepeseg {
namespace {

constexpr char kBare[] = "scenes/bare/models/live";

struct ModelWithoutFeatures : ServiceTest {
  ModelWithoutFeatures() : ServiceTest(PEPESEG_MODEL_WORKER) {
    running.CreateScene("bare");
    TrainToTheEnd("bare", "bare");
  }
  static void ExpectNoFeatures(const grpc::Status& status) {
    EXPECT_ERROR(status, grpc::FAILED_PRECONDITION,
                 {.reason = "NO_FEATURES", .resource = "scenes/bare/models/1"});
  }
  grpc::Status Export(const v1::ExportGaussiansRequest& request) {
    grpc::ClientContext context;
    const auto stream = running.renders->ExportGaussians(&context, request);
    for (v1::ExportGaussiansResponse part; stream->Read(&part);) {
    }
    return stream->Finish();
  }
  grpc::Status Render(v1::RenderViewRequest::Content content) {
    v1::RenderViewRequest request;
    request.set_model(kBare);
    request.set_content(content);
    request.mutable_viewpoint()->set_view("middle.jpg");
    const auto reply = Call(&RenderStub::RenderView, request);
    EXPECT_TRUE(!reply.ok() || !reply->png().empty());
    return reply;
  }
};

TEST_F(ModelWithoutFeatures, HasViewsAndPictures) {
  EXPECT_EQ(Call(&SceneStub::ListViews, Under{kBare})->views_size(), 3);
  EXPECT_OK(Render(v1::RenderViewRequest::CONTENT_COLOR));
  EXPECT_OK(Render(v1::RenderViewRequest::CONTENT_DEPTH));
}

TEST_F(ModelWithoutFeatures, ExplainsWhyThereAreNoSegments) {
  ExpectNoFeatures(Render(v1::RenderViewRequest::CONTENT_SEGMENTS));
  ExpectNoFeatures(Render(v1::RenderViewRequest::CONTENT_FEATURES));
  v1::SegmentViewsRequest click;
  click.set_model(kBare);
  *click.mutable_prompt() = ClickAt(30, 0);
  ExpectNoFeatures(Call(&SegmentationStub::SegmentViews, click));
  v1::DecomposeModelRequest whole;
  whole.set_model(kBare);
  ExpectNoFeatures(Call(&SegmentationStub::DecomposeModel, whole));
  v1::ExportGaussiansRequest ids;
  ids.set_model(kBare);
  ids.mutable_segment_ids();
  ExpectNoFeatures(Export(ids));
}

TEST_F(ModelWithoutFeatures, HasSelectionsOfGivenGaussians) {
  const int64_t count = Call(&SceneStub::GetModel, Named{kBare})->num_gaussians();
  v1::CreateSelectionRequest request;
  request.set_model(kBare);
  request.mutable_gaussians()->set_bits(std::string((count + 7) / 8, '\1'));
  EXPECT_EQ(Call(&SelectionStub::CreateSelection, request)->num_gaussians(), (count + 7) / 8);
  request.clear_gaussians();
  *request.mutable_prompt() = ClickAt(30);
  ExpectNoFeatures(Call(&SelectionStub::CreateSelection, request));
}

TEST_F(ModelWithoutFeatures, IsExported) {
  v1::ExportGaussiansRequest request;
  request.set_model(kBare);
  for (const auto format :
       {v1::GAUSSIAN_FORMAT_PLY, v1::GAUSSIAN_FORMAT_SPZ, v1::GAUSSIAN_FORMAT_GLB,
        v1::GAUSSIAN_FORMAT_SOG, v1::GAUSSIAN_FORMAT_HTML}) {
    request.set_format(format);
    EXPECT_OK(Export(request));
  }
}

}  // namespace
}  // namespace pepeseg
