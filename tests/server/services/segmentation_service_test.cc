#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <functional>
#include <limits>

#include "core/formats/rle.h"
#include "tests/server/shelf_model.h"

namespace pepeseg {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

struct SegmentationServiceTest : ShelfModel {
  static v1::SegmentViewsRequest Click(double x, double y = 32) {
    return pepeseg::Click<v1::SegmentViewsRequest>(x, y);
  }
  Reply<v1::SegmentViewsResponse> Segment(const v1::SegmentViewsRequest& request) const {
    return Call(&SegmentationStub::SegmentViews, request);
  }
  void ExpectRefused(const v1::SegmentViewsRequest& request, const std::string& words) const {
    EXPECT_ERROR(Segment(request), grpc::INVALID_ARGUMENT, {.message = words});
  }
};

// Row-major indices of the pixels of a mask.
std::vector<uint32_t> PixelsOf(const v1::CocoRle& rle) {
  const auto counts = ParseCocoCounts(rle.counts());
  EXPECT_OK(counts);
  if (!counts.ok()) return {};
  auto pixels = PixelsOfRuns(*counts, rle.width(), rle.height());
  EXPECT_OK(pixels);
  return pixels.ok() ? *pixels : std::vector<uint32_t>();
}

TEST_F(SegmentationServiceTest, FindsAClickedSquareInOtherViews) {
  auto request = Click(30);  // the red one, left of the middle
  request.mutable_granularity()->set_scale_quantile(0.5);
  request.mutable_granularity()->set_threshold(0.75);
  request.mutable_targets()->set_group(v1::SegmentViewsRequest::Targets::GROUP_HELD_OUT);
  ASSERT_OK_AND_ASSIGN(auto answer, Segment(request));
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
  auto request = Click(30);
  request.set_mask_encoding(v1::MASK_ENCODING_PNG);
  request.set_want_similarity(true);
  ASSERT_OK_AND_ASSIGN(auto answer, Segment(request));
  ASSERT_EQ(answer.masks_size(), 1);
  EXPECT_EQ(answer.masks(0).view(), "middle.jpg");
  EXPECT_EQ(answer.masks(0).png().substr(1, 3), "PNG");
  const auto& similarity = answer.masks(0).similarity();
  EXPECT_EQ(similarity.width(), 96);
  EXPECT_EQ(similarity.height(), 64);
  EXPECT_EQ(similarity.values().size(), size_t{2} * 96 * 64);
  EXPECT_TRUE(answer.timing().has_compute());
}

TEST_F(SegmentationServiceTest, RefinesBordersUnlessTheClientDeclines) {
  auto request = Click(30);
  request.mutable_granularity()->set_threshold(0.97);  // too high at the border
  ASSERT_OK_AND_ASSIGN(const auto refined, Segment(request));
  request.set_refine_borders(true);
  EXPECT_EQ(Segment(request)->masks(0).area(), refined.masks(0).area());
  request.set_refine_borders(false);
  ASSERT_OK_AND_ASSIGN(const auto plain, Segment(request));
  EXPECT_NE(refined.masks(0).area(), plain.masks(0).area());
  EXPECT_NEAR(static_cast<double>(refined.masks(0).area()),
              static_cast<double>(plain.masks(0).area()),
              0.25 * static_cast<double>(plain.masks(0).area()));
}

TEST_F(SegmentationServiceTest, AcceptsAFreeCameraAndUnits) {
  auto request = Click(66);
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
  ASSERT_OK_AND_ASSIGN(auto answer, Segment(request));
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
  EXPECT_ERROR(Segment(request), grpc::INVALID_ARGUMENT,
               "prompt.view.free.cam_from_world.rotation");
}

TEST_F(SegmentationServiceTest, RefusesInvalidRequests) {
  ExpectRefused(Click(96), "96");
  ExpectRefused(Click(30, -1), "-1");
  ExpectRefused(Click(kNan), "points.points[0]");
  EXPECT_ERROR(Segment(Click(2, 2)), grpc::INVALID_ARGUMENT) << "nothing is there";
  using Change = std::function<void(v1::SegmentViewsRequest&)>;
  const std::vector<std::pair<std::string, Change>> cases = {
      {"prompt.view.view: 'nowhere.jpg'",
       [](auto& request) { request.mutable_prompt()->mutable_view()->set_view("nowhere.jpg"); }},
      {"no positive point",
       [](auto& request) {
         request.mutable_prompt()->mutable_points()->mutable_points(0)->set_negative(true);
       }},
      {"prompt", [](auto& request) { request.mutable_prompt()->clear_points(); }},
      {"prompt.view", [](auto& request) { request.mutable_prompt()->clear_view(); }},
      {"scale_quantile",
       [](auto& request) { request.mutable_granularity()->set_scale_quantile(1.5); }},
      {"scale_units", [](auto& request) { request.mutable_granularity()->set_scale_units(kNan); }},
      {"threshold", [](auto& request) { request.mutable_granularity()->set_threshold(kNan); }}};
  for (const auto& [words, change] : cases) {
    auto request = Click(30);
    change(request);
    ExpectRefused(request, words);
  }
  auto request = Click(30);
  request.mutable_targets()->add_views("middle.jpg");
  request.mutable_targets()->add_views("nowhere.jpg");
  ExpectRefused(request, "targets.views[1]: 'nowhere.jpg'");
  request.mutable_targets()->set_group(v1::SegmentViewsRequest::Targets::GROUP_ALL);
  ExpectRefused(request, "views next to a group");
}

// Squares of 30 pixels, the red one from about x = 15 and y = 17 on.
TEST_F(SegmentationServiceTest, AnswersABoxInTheBox) {
  auto request = Click(30);
  v1::BoxPrompt& box = *request.mutable_prompt()->mutable_box();
  const auto ask = [&](double x, double y, double side) {
    box.set_x(x);
    box.set_y(y);
    box.set_width(side);
    box.set_height(side);
    return Segment(request);
  };
  ASSERT_OK_AND_ASSIGN(const auto whole, ask(15, 17, 31));
  EXPECT_GT(whole.box_agreement(), 0.7);
  EXPECT_GT(whole.masks(0).area(), 28 * 28);
  ASSERT_OK_AND_ASSIGN(const auto part, ask(26, 28, 8));
  EXPECT_LT(part.box_agreement(), 0.3);
  EXPECT_GE(part.masks(0).box().x(), 21);
  EXPECT_LE(part.masks(0).box().x() + part.masks(0).box().width(), 39);
  EXPECT_LE(part.masks(0).area(), 18 * 18);
  request.mutable_targets()->add_views("right.jpg");
  ASSERT_OK_AND_ASSIGN(const auto elsewhere, ask(26, 28, 8));
  EXPECT_FALSE(elsewhere.has_box_agreement());
}

TEST_F(SegmentationServiceTest, AnswersAViewOnceThatIsListedTwice) {
  auto request = Click(30);
  for (const char* view : {"right.jpg", "middle.jpg", "right.jpg"}) {
    request.mutable_targets()->add_views(view);
  }
  ASSERT_OK_AND_ASSIGN(const auto answer, Segment(request));
  ASSERT_EQ(answer.masks_size(), 2);
  EXPECT_EQ(answer.masks(0).view(), "right.jpg");
  EXPECT_EQ(answer.masks(1).view(), "middle.jpg");
}

TEST_F(SegmentationServiceTest, ListsTheViews) {
  v1::ListViewsRequest request = Under{kModel};
  request.set_page_size(2);
  std::vector<std::string> names;
  do {
    ASSERT_OK_AND_ASSIGN(const v1::ListViewsResponse views, Call(&SceneStub::ListViews, request));
    for (const v1::View& view : views.views()) {
      names.push_back(view.view());
      EXPECT_EQ(view.camera().width(), 96);
      EXPECT_EQ(view.held_out(), view.view() != "middle.jpg");
    }
    request.set_page_token(views.next_page_token());
  } while (!request.page_token().empty());
  EXPECT_EQ(names, (std::vector<std::string>{"left/0.jpg", "middle.jpg", "right.jpg"}));
  request.set_page_token("4");
  EXPECT_ERROR(Call(&SceneStub::ListViews, request), grpc::INVALID_ARGUMENT);
}

TEST_F(SegmentationServiceTest, ReportsADamagedModelAndContinues) {
  const auto ply = running.options.data / "jobs/j1/attempt-1/gaussians.ply";
  ASSERT_TRUE(std::filesystem::exists(ply));
  {
    std::fstream file(ply, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(2000);
    file.put('!');
  }
  EXPECT_ERROR(Segment(Click(30)), grpc::DATA_LOSS);
  grpc::ClientContext context;
  v1::ExportGaussiansRequest request;
  request.set_model(kModel);
  const auto stream = running.renders->ExportGaussians(&context, request);
  v1::ExportGaussiansResponse part;
  while (stream->Read(&part)) {
  }
  EXPECT_ERROR(stream->Finish(), grpc::DATA_LOSS);
  EXPECT_TRUE(running.GetUpload("scenes/shelf/uploads/1").sealed());
}

TEST(ModelNames, DistinguishMissingFromNotYet) {
  RunningServer running(PEPESEG_FAKE_WORKER);
  running.CreateScene("shelf");
  const v1::Job job = running.Train("shelf", "hang");
  const auto render = [&](const std::string& model) {
    v1::RenderViewRequest request;
    request.set_model(model);
    return running.Call(&RenderStub::RenderView, request);
  };
  EXPECT_ERROR(render("scenes/shelf/models/live"), grpc::FAILED_PRECONDITION,
               {.reason = "NO_MODEL", .resource = job.name(), .message = "j1"});
  EXPECT_ERROR(render("scenes/shelf/models/7"), grpc::NOT_FOUND);
  EXPECT_ERROR(render("scenes/none/models/live"), grpc::NOT_FOUND);
  EXPECT_ERROR(render("models/7"), grpc::INVALID_ARGUMENT);
  EXPECT_ERROR(render("scenes/../models/7"), grpc::INVALID_ARGUMENT);
}

}  // namespace
}  // namespace pepeseg
