#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <limits>

#include "core/base/digest.h"
#include "core/formats/decode_image.h"
#include "core/formats/rle.h"
#include "tests/server/running_server.h"

namespace pepeseg {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// A scene with the model of model_worker.cc.
struct SegmentationServiceTest : ::testing::Test {
  SegmentationServiceTest() : running(PEPESEG_MODEL_WORKER) {
    running.CreateScene("shelf");
    const v1::Job job = running.Await(running.Train("shelf", "file").name());
    EXPECT_EQ(job.state(), v1::JOB_STATE_SUCCEEDED) << job.DebugString();
  }

  static v1::SegmentViewsRequest Click(const std::string& view, double x, double y) {
    v1::SegmentViewsRequest request;
    request.set_model("scenes/shelf/models/live");
    request.mutable_prompt()->mutable_view()->set_view(view);
    auto* point = request.mutable_prompt()->mutable_points()->add_points();
    point->set_x(x);
    point->set_y(y);
    return request;
  }
  grpc::Status Segment(const v1::SegmentViewsRequest& request) {
    grpc::ClientContext context;
    answer.Clear();
    return running.segmentation->SegmentViews(&context, request, &answer);
  }
  void ExpectRefused(const v1::SegmentViewsRequest& request, const std::string& words) {
    const grpc::Status status = Segment(request);
    EXPECT_EQ(status.error_code(), grpc::INVALID_ARGUMENT) << words;
    EXPECT_NE(status.error_message().find(words), std::string::npos) << status.error_message();
  }
  grpc::Status Render(const v1::RenderViewRequest& request) {
    grpc::ClientContext context;
    return running.renders->RenderView(&context, request, &picture);
  }

  RunningServer running;
  v1::SegmentViewsResponse answer;
  v1::RenderViewResponse picture;
};

// Row-major indices of the pixels of a mask.
std::vector<uint32_t> PixelsOf(const v1::CocoRle& rle) {
  const auto counts = ParseCocoCounts(rle.counts());
  EXPECT_TRUE(counts.ok()) << counts.status();
  if (!counts.ok()) return {};
  auto pixels = PixelsOfRuns(*counts, rle.width(), rle.height());
  EXPECT_TRUE(pixels.ok()) << pixels.status();
  return pixels.ok() ? *pixels : std::vector<uint32_t>();
}

TEST_F(SegmentationServiceTest, FindsAClickedSquareInOtherViews) {
  auto request = Click("middle.jpg", 30, 32);  // the red one, left of the middle
  request.mutable_granularity()->set_scale_quantile(0.5);
  request.mutable_granularity()->set_threshold(0.75);
  request.mutable_targets()->set_group(v1::SegmentViewsRequest::Targets::GROUP_HELD_OUT);
  const grpc::Status status = Segment(request);
  ASSERT_TRUE(status.ok()) << status.error_message();
  ASSERT_EQ(answer.masks_size(), 2);
  EXPECT_EQ(answer.masks(0).view(), "left/0.jpg");
  EXPECT_EQ(answer.masks(1).view(), "right.jpg");
  EXPECT_EQ(answer.model(), "scenes/shelf/models/1");
  EXPECT_EQ(answer.scale_quantile(), 0.5);
  EXPECT_NEAR(answer.scale_units(), 0.5, 0.01);
  for (const auto& mask : answer.masks()) {
    ASSERT_TRUE(mask.has_rle());
    const auto pixels = PixelsOf(mask.rle());
    EXPECT_EQ(static_cast<int64_t>(pixels.size()), mask.area());
    // A unit square, 2 units away, at 60 pixels of focal length, is 30 pixels wide. Similarity is
    // an angle, so pixels of its fringe count too: a splat of sigma sqrt(0.3 + 0.3^2) pixels is
    // drawn out to alpha 1 / 255, some 2 pixels beyond the square on each side.
    EXPECT_GE(mask.area(), 29 * 29);
    EXPECT_LE(mask.area(), 35 * 35);
    EXPECT_GT(mask.score(), 0.9);
    int left = 96;
    int right = 0;
    for (uint32_t pixel : pixels) {
      left = std::min(left, static_cast<int>(pixel % 96));
      right = std::max(right, static_cast<int>(pixel % 96));
    }
    EXPECT_EQ(mask.box().x(), left);
    EXPECT_EQ(mask.box().x() + mask.box().width(), right + 1);
    EXPECT_LT(right, 52) << "the blue one is right of the middle";
  }
}

TEST_F(SegmentationServiceTest, ReturnsPngAndSimilarityOnRequest) {
  auto request = Click("middle.jpg", 30, 32);
  request.set_mask_encoding(v1::MASK_ENCODING_PNG);
  request.set_want_similarity(true);
  ASSERT_TRUE(Segment(request).ok());
  ASSERT_EQ(answer.masks_size(), 1);
  EXPECT_EQ(answer.masks(0).view(), "middle.jpg");
  EXPECT_EQ(answer.masks(0).png().substr(1, 3), "PNG");
  const auto& similarity = answer.masks(0).similarity();
  EXPECT_EQ(similarity.width(), 96);
  EXPECT_EQ(similarity.height(), 64);
  EXPECT_EQ(similarity.values().size(), size_t{2} * 96 * 64);
  EXPECT_TRUE(answer.timing().has_compute());
}

TEST_F(SegmentationServiceTest, AcceptsAFreeCameraAndUnits) {
  auto request = Click("middle.jpg", 66, 32);
  request.mutable_prompt()->clear_view();
  v1::Viewpoint::FreeCamera& free = *request.mutable_prompt()->mutable_view()->mutable_free();
  free.mutable_camera()->set_width(96);
  free.mutable_camera()->set_height(64);
  free.mutable_camera()->set_fx(60);
  free.mutable_camera()->set_fy(60);
  free.mutable_camera()->set_cx(48);
  free.mutable_camera()->set_cy(32);
  free.mutable_cam_from_world()->mutable_rotation()->set_w(1);
  free.mutable_cam_from_world()->mutable_translation();
  request.mutable_granularity()->set_scale_units(0.25);
  request.mutable_granularity()->set_threshold(0.6);
  const grpc::Status status = Segment(request);
  ASSERT_TRUE(status.ok()) << status.error_message();
  EXPECT_EQ(answer.masks(0).view(), "");
  EXPECT_GE(answer.masks(0).box().x(), 46) << "the blue one";
  EXPECT_NEAR(answer.scale_quantile(), 0.25, 0.01);
  EXPECT_EQ(answer.threshold(), 0.6);

  free.mutable_camera()->set_fx(kNan);
  ExpectRefused(request, "prompt.view.free.camera.fx");
  free.mutable_camera()->set_fx(60);
  free.mutable_cam_from_world()->mutable_translation()->set_z(kNan);
  ExpectRefused(request, "prompt.view.free.cam_from_world.translation.z");
  free.mutable_cam_from_world()->clear_rotation();
  EXPECT_EQ(DetailOf(Segment(request)).field(), "prompt.view.free.cam_from_world.rotation");
}

TEST_F(SegmentationServiceTest, RefusesInvalidRequests) {
  ExpectRefused(Click("middle.jpg", 96, 32), "96");
  ExpectRefused(Click("middle.jpg", 30, -1), "-1");
  ExpectRefused(Click("middle.jpg", kNan, 32), "points.points[0]");
  ExpectRefused(Click("nowhere.jpg", 30, 32), "prompt.view.view: 'nowhere.jpg'");
  EXPECT_EQ(Segment(Click("middle.jpg", 2, 2)).error_code(), grpc::INVALID_ARGUMENT)
      << "nothing is there";
  auto request = Click("middle.jpg", 30, 32);
  request.mutable_prompt()->mutable_points()->mutable_points(0)->set_negative(true);
  ExpectRefused(request, "no positive point");
  request = Click("middle.jpg", 30, 32);
  request.mutable_prompt()->clear_points();
  ExpectRefused(request, "prompt");
  request = Click("middle.jpg", 30, 32);
  request.mutable_prompt()->clear_view();
  ExpectRefused(request, "prompt.view");
  request = Click("middle.jpg", 30, 32);
  request.mutable_granularity()->set_scale_quantile(1.5);
  ExpectRefused(request, "scale_quantile");
  request.mutable_granularity()->set_scale_units(kNan);
  ExpectRefused(request, "scale_units");
  request = Click("middle.jpg", 30, 32);
  request.mutable_granularity()->set_threshold(kNan);
  ExpectRefused(request, "threshold");
  request = Click("middle.jpg", 30, 32);
  request.mutable_targets()->add_views("middle.jpg");
  request.mutable_targets()->add_views("nowhere.jpg");
  ExpectRefused(request, "targets.views[1]: 'nowhere.jpg'");
  request.mutable_targets()->set_group(v1::SegmentViewsRequest::Targets::GROUP_ALL);
  ExpectRefused(request, "views next to a group");
}

TEST_F(SegmentationServiceTest, RefusesAnAnswerThatIsTooLarge) {
  auto request = Click("middle.jpg", 30, 32);
  request.set_want_similarity(true);
  for (int i = 0; i < 400; ++i) request.mutable_targets()->add_views("middle.jpg");
  const grpc::Status status = Segment(request);
  EXPECT_EQ(status.error_code(), grpc::RESOURCE_EXHAUSTED);
  EXPECT_EQ(DetailOf(status).reason(), "ANSWER_TOO_LARGE");
}

TEST_F(SegmentationServiceTest, RendersViews) {
  v1::RenderViewRequest request;
  request.set_model("scenes/shelf/models/1");
  request.mutable_viewpoint()->set_view("middle.jpg");
  const grpc::Status status = Render(request);
  ASSERT_TRUE(status.ok()) << status.error_message();
  EXPECT_EQ(picture.width(), 96);
  EXPECT_EQ(picture.height(), 64);
  const auto path = running.folder / "picture.png";
  std::ofstream(path, std::ios::binary) << picture.png();
  const auto image = DecodePhoto(path, "picture.png");
  ASSERT_TRUE(image.ok()) << image.status();
  const auto pixel = [&](int x, int y) { return &image->pixels[3 * (y * 96 + x)]; };
  EXPECT_GT(pixel(30, 32)[0], 200);
  EXPECT_LT(pixel(30, 32)[2], 60);
  EXPECT_GT(pixel(66, 32)[2], 200);
  EXPECT_LT(pixel(66, 32)[0], 60);
  request.mutable_viewpoint()->set_view("nowhere.jpg");
  EXPECT_EQ(Render(request).error_code(), grpc::INVALID_ARGUMENT);
  request.clear_viewpoint();
  EXPECT_EQ(Render(request).error_code(), grpc::INVALID_ARGUMENT);
}

TEST_F(SegmentationServiceTest, ListsTheViews) {
  v1::ListViewsRequest request;
  request.set_parent("scenes/shelf/models/live");
  request.set_page_size(2);
  std::vector<std::string> names;
  do {
    grpc::ClientContext context;
    v1::ListViewsResponse views;
    ASSERT_TRUE(running.scenes->ListViews(&context, request, &views).ok());
    for (const v1::View& view : views.views()) {
      names.push_back(view.view());
      EXPECT_EQ(view.camera().width(), 96);
      EXPECT_EQ(view.held_out(), view.view() != "middle.jpg");
    }
    request.set_page_token(views.next_page_token());
  } while (!request.page_token().empty());
  EXPECT_EQ(names, (std::vector<std::string>{"left/0.jpg", "middle.jpg", "right.jpg"}));
  request.set_page_token("4");
  grpc::ClientContext context;
  v1::ListViewsResponse views;
  EXPECT_EQ(running.scenes->ListViews(&context, request, &views).error_code(),
            grpc::INVALID_ARGUMENT);
}

TEST_F(SegmentationServiceTest, ExportsThePlyInCheckedChunks) {
  grpc::ClientContext context;
  v1::ExportGaussiansRequest request;
  request.set_model("scenes/shelf/models/live");
  const auto stream = running.renders->ExportGaussians(&context, request);
  v1::ExportGaussiansResponse part;
  ASSERT_TRUE(stream->Read(&part));
  ASSERT_TRUE(part.has_header());
  const auto header = part.header();
  EXPECT_EQ(header.num_gaussians(), 20'000);
  std::string ply;
  int chunks = 0;
  while (stream->Read(&part)) {
    ASSERT_TRUE(part.has_chunk());
    EXPECT_LE(part.chunk().data().size(), size_t{1} << 20);
    EXPECT_EQ(part.chunk().crc32c(), Crc32c(part.chunk().data()));
    ply += part.chunk().data();
    ++chunks;
  }
  const grpc::Status status = stream->Finish();
  ASSERT_TRUE(status.ok()) << status.error_message();
  EXPECT_GT(chunks, 1);
  EXPECT_EQ(static_cast<int64_t>(ply.size()), header.num_bytes());
  EXPECT_EQ(Sha256Hex(ply), header.sha256());
  EXPECT_EQ(ply.substr(0, 3), "ply");
}

TEST_F(SegmentationServiceTest, ReportsADamagedModelAndContinues) {
  const auto ply = running.options.data / "jobs/j1/attempt-1/gaussians.ply";
  ASSERT_TRUE(std::filesystem::exists(ply));
  {
    std::fstream file(ply, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(2000);
    file.put('!');
  }
  EXPECT_EQ(Segment(Click("middle.jpg", 30, 32)).error_code(), grpc::DATA_LOSS);
  grpc::ClientContext context;
  v1::ExportGaussiansRequest request;
  request.set_model("scenes/shelf/models/live");
  const auto stream = running.renders->ExportGaussians(&context, request);
  v1::ExportGaussiansResponse part;
  while (stream->Read(&part)) {
  }
  EXPECT_EQ(stream->Finish().error_code(), grpc::DATA_LOSS);
  EXPECT_TRUE(running.GetUpload("scenes/shelf/uploads/1").sealed());
}

TEST_F(SegmentationServiceTest, FreesACancelledExport) {
  for (int i = 0; i < 10; ++i) {
    grpc::ClientContext context;
    v1::ExportGaussiansRequest request;
    request.set_model("scenes/shelf/models/live");
    const auto stream = running.renders->ExportGaussians(&context, request);
    v1::ExportGaussiansResponse part;
    EXPECT_TRUE(stream->Read(&part));
    context.TryCancel();
    while (stream->Read(&part)) {
    }
    EXPECT_EQ(stream->Finish().error_code(), grpc::CANCELLED);
  }
  EXPECT_TRUE(Segment(Click("middle.jpg", 30, 32)).ok());
}

TEST(ModelNames, DistinguishMissingFromNotYet) {
  RunningServer running(PEPESEG_FAKE_WORKER);
  running.CreateScene("shelf");
  const v1::Job job = running.Train("shelf", "hang");
  v1::RenderViewRequest request;
  v1::RenderViewResponse response;
  const auto render = [&](const std::string& model) {
    grpc::ClientContext context;
    request.set_model(model);
    return running.renders->RenderView(&context, request, &response);
  };
  const grpc::Status not_yet = render("scenes/shelf/models/live");
  EXPECT_EQ(not_yet.error_code(), grpc::FAILED_PRECONDITION);
  EXPECT_EQ(DetailOf(not_yet).reason(), "NO_MODEL");
  EXPECT_EQ(DetailOf(not_yet).resource(), job.name());
  EXPECT_NE(not_yet.error_message().find("j1"), std::string::npos) << not_yet.error_message();
  EXPECT_EQ(render("scenes/shelf/models/7").error_code(), grpc::NOT_FOUND);
  EXPECT_EQ(render("scenes/none/models/live").error_code(), grpc::NOT_FOUND);
  EXPECT_EQ(render("models/7").error_code(), grpc::INVALID_ARGUMENT);
  EXPECT_EQ(render("scenes/../models/7").error_code(), grpc::INVALID_ARGUMENT);
}

}  // namespace
}  // namespace pepeseg
