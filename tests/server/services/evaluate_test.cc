#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <thread>

#include "core/evaluate/one_click.h"
#include "core/formats/encode_png.h"
#include "core/formats/rle.h"
#include "server/api/evaluation.h"
#include "tests/server/shelf_model.h"
#include "tests/testing/png_bytes.h"

namespace pepeseg {
namespace {

constexpr char kLeftView[] = "left/0.jpg", kRightView[] = "right.jpg";  // those held out
constexpr uint16_t kRed = 3, kBlue = 700;

// 16-bit label image of one of the model's views.
struct Labels {
  std::vector<uint16_t> ids = std::vector<uint16_t>(kWidth * kHeight);

  void FillRows(int first, int last, uint16_t id) {
    std::fill(ids.begin() + first * kWidth, ids.begin() + last * kWidth, id);
  }
  std::string Png() const {
    std::string rows;
    for (int i = 0; i < kWidth * kHeight; ++i) {
      if (i % kWidth == 0) rows += '\0';
      rows += static_cast<char>(ids[i] >> 8);
      rows += static_cast<char>(ids[i] & 0xff);
    }
    return testing::GreyPng(kWidth, kHeight, 16, rows);
  }
};

// A scene with the model of model_worker.cc: a red square and a blue one. Their features have no
// scale and are orthogonal, so that every scale and threshold selects one of them exactly.
struct EvaluateTest : ::testing::Test {
  EvaluateTest() : running(PEPESEG_MODEL_WORKER) {
    running.CreateScene("shelf");
    const v1::Job job = running.Await(running.Train("shelf", "file").name());
    EXPECT_EQ(job.state(), v1::JOB_STATE_SUCCEEDED) << job.DebugString();
    left = Truth(kLeftView);
    right = Truth(kRightView);
  }

  // The pixels of a square in a view.
  std::vector<uint32_t> Square(const std::string& view, double x) {
    v1::SegmentViewsRequest request;
    request.set_model("scenes/shelf/models/live");
    request.mutable_prompt()->mutable_view()->set_view(view);
    request.mutable_prompt()->mutable_points()->add_points()->set_x(x);
    request.mutable_prompt()->mutable_points()->mutable_points(0)->set_y(32);
    grpc::ClientContext context;
    v1::SegmentViewsResponse segments;
    EXPECT_TRUE(running.segmentation->SegmentViews(&context, request, &segments).ok());
    const auto counts = ParseCocoCounts(segments.masks(0).rle().counts());
    return *PixelsOfRuns(*counts, kWidth, kHeight);
  }
  Labels Truth(const std::string& view) {
    Labels labels;
    for (const uint32_t pixel : Square(view, 30)) labels.ids[pixel] = kRed;
    for (const uint32_t pixel : Square(view, 66)) labels.ids[pixel] = kBlue;
    return labels;
  }
  v1::EvaluateModelRequest Request() const {
    v1::EvaluateModelRequest request;
    request.set_model("scenes/shelf/models/live");
    for (const auto& [view, labels] : {std::pair(kRightView, &right), {kLeftView, &left}}) {
      request.add_labels()->set_view(view);
      request.mutable_labels(request.labels_size() - 1)->set_png(labels->Png());
    }
    (*request.mutable_entity_names())[kBlue] = "the blue one";
    (*request.mutable_entity_names())[9] = "of nothing";
    return request;
  }
  grpc::Status Evaluate(const v1::EvaluateModelRequest& request) {
    grpc::ClientContext context;
    answer.Clear();
    return running.evaluations->EvaluateModel(&context, request, &answer);
  }
  void ExpectRefused(const v1::EvaluateModelRequest& request, const std::string& field,
                     const std::string& words) {
    const grpc::Status status = Evaluate(request);
    EXPECT_EQ(status.error_code(), grpc::INVALID_ARGUMENT) << words;
    EXPECT_NE(status.error_message().find(words), std::string::npos) << status.error_message();
    if (field.empty()) return;
    EXPECT_EQ(DetailOf(status).field(), field);
  }

  RunningServer running;
  Labels left, right;
  v1::EvaluateModelResponse answer;
};

TEST_F(EvaluateTest, ScoresEveryEntityOnTheViewsOtherThanItsReference) {
  const auto red = static_cast<double>(std::count(right.ids.begin(), right.ids.end(), kRed));
  right.FillRows(0, 2, kRed);  // 192 pixels where nothing is
  const grpc::Status status = Evaluate(Request());
  ASSERT_TRUE(status.ok()) << status.error_message();
  EXPECT_EQ(answer.model(), "scenes/shelf/models/1");
  EXPECT_TRUE(answer.has_compute());
  ASSERT_EQ(answer.entities_size(), 2);
  const auto& first = answer.entities(0);
  EXPECT_EQ(first.id(), kRed);
  EXPECT_EQ(first.name(), "");
  EXPECT_FALSE(first.missing());
  ASSERT_EQ(first.views_size(), 2);
  EXPECT_EQ(first.views(0).view(), kLeftView) << "the first by name";
  EXPECT_EQ(first.views(1).num_pixels(), static_cast<int64_t>(red) + 192);
  EXPECT_EQ(first.chosen().scale_quantile(), 0.01);
  EXPECT_EQ(first.chosen().threshold(), 0.5);
  const double iou = red / (red + 192);
  EXPECT_NEAR(first.chosen().iou(), iou, 1e-12);
  EXPECT_NEAR(first.oracle().iou(), iou, 1e-12);
  EXPECT_LT(first.chosen().boundary_iou(), 1);
  EXPECT_GT(first.chosen().boundary_iou(), 0);
  ASSERT_EQ(first.fixed_iou_size(), 11);
  EXPECT_NEAR(first.fixed_iou(3), iou, 1e-12);
  EXPECT_NEAR(first.views(0).fixed_iou(3), 1, 1e-12);
  EXPECT_EQ(answer.entities(1).id(), kBlue);
  EXPECT_EQ(answer.entities(1).name(), "the blue one");
  EXPECT_NEAR(answer.entities(1).chosen().iou(), 1, 1e-12);
  EXPECT_NEAR(answer.entities(1).chosen().boundary_iou(), 1, 1e-12);
  EXPECT_NEAR(answer.chosen().iou(), (1 + iou) / 2, 1e-12);
  EXPECT_NEAR(answer.fixed_iou(10), (1 + iou) / 2, 1e-12);
  EXPECT_EQ(answer.options().DebugString(), ToProto(OneClickOptions()).DebugString());
}

TEST_F(EvaluateTest, TakesOptionsAndIgnoreMasks) {
  right.FillRows(0, 2, kRed);
  right.FillRows(60, 64, 5);  // in one view only
  auto request = Request();
  Labels ignore;
  ignore.FillRows(0, 2, 1);
  request.mutable_labels(0)->set_ignore_png(ignore.Png());
  request.mutable_options()->add_fixed_scales(0.25);
  request.mutable_options()->set_fixed_threshold(0.6);
  const grpc::Status status = Evaluate(request);
  ASSERT_TRUE(status.ok()) << status.error_message();
  EXPECT_NEAR(answer.chosen().iou(), 1, 1e-12);
  ASSERT_EQ(answer.fixed_iou_size(), 1);
  EXPECT_NEAR(answer.fixed_iou(0), 1, 1e-12);
  EXPECT_EQ(answer.options().fixed_scales(0), 0.25);
  EXPECT_EQ(answer.options().fixed_threshold(), 0.6);
  EXPECT_EQ(answer.options().scales_size(), 11);
  ASSERT_EQ(answer.left_out_size(), 1);
  EXPECT_EQ(answer.left_out(0), 5);
}

TEST_F(EvaluateTest, ScoresAClickOnNothingAsZero) {
  left.FillRows(58, 64, 9);
  right.FillRows(58, 64, 9);
  const grpc::Status status = Evaluate(Request());
  ASSERT_TRUE(status.ok()) << status.error_message();
  ASSERT_EQ(answer.entities_size(), 3);
  EXPECT_EQ(answer.entities(1).name(), "of nothing");
  EXPECT_TRUE(answer.entities(1).missing());
  EXPECT_EQ(answer.entities(1).chosen().iou(), 0);
  EXPECT_NEAR(answer.chosen().iou(), 2.0 / 3, 1e-12);
}

TEST_F(EvaluateTest, RefusesViewsThatCannotBeScored) {
  auto request = Request();
  request.mutable_labels(1)->set_view("nowhere.jpg");
  ExpectRefused(request, "labels[1].view", "'nowhere.jpg': no view of the model");
  request.mutable_labels(1)->set_view("middle.jpg");
  ExpectRefused(request, "labels[1].view", "'middle.jpg': not held out");
  request.mutable_labels(1)->set_view(kRightView);
  ExpectRefused(request, "labels[1].view", "has labels already");
  request = Request();
  request.mutable_labels()->RemoveLast();
  ExpectRefused(request, "labels", "allowed are 2..1000");
  while (request.labels_size() <= 1000) request.add_labels()->set_view(kRightView);
  ExpectRefused(request, "labels", "'1001': views; allowed are 2..1000");
  std::fill(left.ids.begin(), left.ids.end(), uint16_t{0});
  ExpectRefused(Request(), "", "no entity shows at least 100 pixels in at least 2 of the 2");
}

TEST_F(EvaluateTest, RefusesFilesThatAreNotLabels) {
  const auto expect_refused = [&](const std::string& png, const std::string& words) {
    auto request = Request();
    request.mutable_labels(0)->set_png(png);
    ExpectRefused(request, "labels[0].png", words);
    request = Request();
    if (png.empty()) return;  // without an ignore mask
    request.mutable_labels(1)->set_ignore_png(png);
    ExpectRefused(request, "labels[1].ignore_png", words);
  };
  expect_refused("", "not a whole PNG");
  expect_refused("labels", "not a whole PNG");
  expect_refused(left.Png().substr(0, left.Png().size() / 2), "not a whole PNG");
  expect_refused(testing::BlackPng(97, 64, 16), "'97x64': pixels; photograph ");
  expect_refused(testing::BlackPng(30'000, 2'000, 1), " has 96x64");
  const Image colour{kWidth, kHeight, 3, std::vector<uint8_t>(size_t{3} * kWidth * kHeight)};
  expect_refused(*EncodePng(colour), "has colours instead of one grey value");
  expect_refused(*EncodeJpeg({kWidth, kHeight, 1, std::vector<uint8_t>(kWidth * kHeight)}),
                 "not a whole PNG");
}

TEST_F(EvaluateTest, RefusesOptionsOutOfRange) {
  auto request = Request();
  request.mutable_options()->add_scales(1.5);
  ExpectRefused(request, "", "options.scales[0] is 1.5, must be in [0, 1]");
  request.mutable_options()->clear_scales();
  request.mutable_options()->add_thresholds(NAN);
  ExpectRefused(request, "", "options.thresholds[0] is nan");
  request.mutable_options()->clear_thresholds();
  for (int i = 0; i <= 100; ++i) request.mutable_options()->add_fixed_scales(0.001 * i);
  ExpectRefused(request, "", "options.fixed_scales has 101 values");
  request.mutable_options()->clear_fixed_scales();
  request.mutable_options()->set_min_pixels(0);
  ExpectRefused(request, "", "options.min_pixels is 0");
  request = Request();
  request.set_model("scenes/none/models/live");
  EXPECT_EQ(Evaluate(request).error_code(), grpc::NOT_FOUND);
}

TEST_F(EvaluateTest, EndsAtItsDeadlineAndBlocksNoQuery) {
  auto request = Request();
  for (int i = 0; i < 100; ++i) {  // as long as an evaluation can be made here
    request.mutable_options()->add_scales(0.01 * i);
    request.mutable_options()->add_fixed_scales(0.01 * i + 0.005);
  }
  std::vector<grpc::StatusCode> codes(6, grpc::UNKNOWN);
  std::vector<std::thread> threads;
  threads.reserve(codes.size());
  for (grpc::StatusCode& code : codes) {
    threads.emplace_back([&] {
      grpc::ClientContext context;
      context.set_deadline(std::chrono::system_clock::now() + std::chrono::milliseconds(1));
      v1::EvaluateModelResponse response;
      code = running.evaluations->EvaluateModel(&context, request, &response).error_code();
    });
  }
  EXPECT_FALSE(Square(kLeftView, 30).empty());
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(codes, std::vector<grpc::StatusCode>(6, grpc::DEADLINE_EXCEEDED));
  EXPECT_TRUE(Evaluate(Request()).ok());
}

}  // namespace
}  // namespace pepeseg
