#pragma once

#include <algorithm>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "core/formats/rle.h"
#include "tests/server/shelf_model.h"
#include "tests/testing/png_bytes.h"

namespace pepeseg {

inline constexpr char kLeftView[] = "left/0.jpg", kRightView[] = "right.jpg";  // those held out
inline constexpr uint16_t kRed = 3, kBlue = 700;

// 16-bit label image of one of the model's views.
struct TruthLabels {
  std::vector<uint16_t> ids = std::vector<uint16_t>(kWidth * kHeight);

  void FillRows(int first, int last, uint16_t id) {
    std::fill(ids.begin() + first * kWidth, ids.begin() + last * kWidth, id);
  }
  // Returns the mask of an id as an 8-bit PNG.
  std::string MaskOf(uint16_t id) const {
    std::string rows;
    for (int i = 0; i < kWidth * kHeight; ++i) {
      if (i % kWidth == 0) rows += '\0';
      rows += ids[i] == id ? '\xff' : '\0';
    }
    return testing::GreyPng(kWidth, kHeight, 8, rows);
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
  TruthLabels Truth(const std::string& view) {
    TruthLabels labels;
    for (const uint32_t pixel : Square(view, 30)) labels.ids[pixel] = kRed;
    for (const uint32_t pixel : Square(view, 66)) labels.ids[pixel] = kBlue;
    return labels;
  }
  v1::EvaluateModelRequest Request() const {
    v1::EvaluateModelRequest request;
    request.set_model("scenes/shelf/models/live");
    for (const auto& [view, labels] : {std::pair(kRightView, &right), {kLeftView, &left}}) {
      request.add_views()->set_view(view);
      request.mutable_views(request.views_size() - 1)->set_labels_png(labels->Png());
    }
    (*request.mutable_entity_names())[kBlue] = "the blue one";
    (*request.mutable_entity_names())[9] = "of nothing";
    return request;
  }
  // A request with a mask for each square: "square.1" is red, "square.2" is blue.
  v1::EvaluateModelRequest MaskRequest() const {
    v1::EvaluateModelRequest request;
    request.set_model("scenes/shelf/models/live");
    for (const auto& [view, labels] : {std::pair(kLeftView, &left), {kRightView, &right}}) {
      v1::ViewTruth& truth = *request.add_views();
      truth.set_view(view);
      AddMask("square.1", labels->MaskOf(kRed), truth);
      AddMask("square.2", labels->MaskOf(kBlue), truth);
    }
    return request;
  }
  static void AddMask(const std::string& entity, const std::string& png, v1::ViewTruth& truth) {
    v1::EntityMask& mask = *truth.add_masks();
    mask.set_entity(entity);
    mask.mutable_mask()->set_png(png);
  }
  // Adds a prompt for an entity in the right view, to be filled.
  static v1::Prompt& AddPrompt(v1::EvaluateModelRequest& request,
                               const std::string& entity = "square.1") {
    v1::Prompt& prompt = (*request.mutable_prompts())[entity];
    prompt.mutable_view()->set_view(kRightView);
    return prompt;
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
  TruthLabels left, right;
  v1::EvaluateModelResponse answer;
};

inline void SetPoint(double x, double y, v1::PointsPrompt& points) {
  v1::PointsPrompt::Point& point = *points.add_points();
  point.set_x(x);
  point.set_y(y);
}

}  // namespace pepeseg
