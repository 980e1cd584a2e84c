#include <gtest/gtest.h>

#include "core/formats/rle.h"
#include "tests/server/shelf_model.h"

namespace pepeseg {
namespace {

// Boxes, masks and labels through Segment; points are in segmentation_service_test.cc.
struct PromptsTest : ShelfModel {
  PromptsTest() {
    request.set_model(kModel);
    request.mutable_prompt()->mutable_view()->set_view("middle.jpg");
  }
  grpc::Status Segment() {
    grpc::ClientContext context;
    answer.Clear();
    return running.segmentation->SegmentViews(&context, request, &answer);
  }
  // The mask that a click selects.
  v1::CocoRle MaskAt(double x) {
    v1::SegmentViewsRequest click = request;
    click.clear_targets();
    click.mutable_prompt()->mutable_view()->set_view("middle.jpg");
    auto* point = click.mutable_prompt()->mutable_points()->add_points();
    point->set_x(x);
    point->set_y(32);
    grpc::ClientContext context;
    v1::SegmentViewsResponse response;
    const grpc::Status status = running.segmentation->SegmentViews(&context, click, &response);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return response.masks_size() == 1 ? response.masks(0).rle() : v1::CocoRle();
  }
  grpc::Status GiveLabel(const std::string& id, double x) {
    v1::CreateLabelRequest create;
    create.set_parent("scenes/shelf");
    create.set_label_id(id);
    create.mutable_label()->set_view("middle.jpg");
    *create.mutable_label()->mutable_mask()->mutable_rle() = MaskAt(x);
    grpc::ClientContext context;
    v1::Label label;
    return running.labels->CreateLabel(&context, create, &label);
  }
  // Pixels of the answer's mask in the left or the right half.
  void ExpectOnlyTheLeft() {
    ASSERT_EQ(answer.masks_size(), 1);
    EXPECT_GT(answer.masks(0).area(), 700);
    EXPECT_LT(answer.masks(0).box().x() + answer.masks(0).box().width(), 52);
  }

  v1::SegmentViewsRequest request;
  v1::SegmentViewsResponse answer;
};

TEST_F(PromptsTest, FindsWhatFillsABox) {
  v1::BoxPrompt& box = *request.mutable_prompt()->mutable_box();
  box.set_x(14), box.set_y(16), box.set_width(32), box.set_height(32);
  const grpc::Status status = Segment();
  ASSERT_TRUE(status.ok()) << status.error_message();
  ExpectOnlyTheLeft();
}

TEST_F(PromptsTest, FindsAMaskInAnotherView) {
  *request.mutable_prompt()->mutable_mask()->mutable_rle() = MaskAt(30);
  request.mutable_targets()->add_views("right.jpg");
  ASSERT_TRUE(Segment().ok());
  EXPECT_EQ(answer.masks(0).view(), "right.jpg");
  ExpectOnlyTheLeft();
}

TEST_F(PromptsTest, FindsALabelByItsIdAndByItsName) {
  ASSERT_TRUE(GiveLabel("red", 30).ok());
  request.mutable_prompt()->clear_view();
  for (const std::string label : {"red", "scenes/shelf/labels/red"}) {
    request.mutable_prompt()->set_label(label);
    const grpc::Status status = Segment();
    ASSERT_TRUE(status.ok()) << status.error_message();
    EXPECT_EQ(answer.masks(0).view(), "middle.jpg");  // its own, where no targets are named
    ExpectOnlyTheLeft();
  }
  request.mutable_targets()->set_group(v1::SegmentViewsRequest::Targets::GROUP_ALL);
  ASSERT_TRUE(Segment().ok());
  EXPECT_EQ(answer.masks_size(), 3);
}

TEST_F(PromptsTest, ListsTheLabelsIfALabelIsUnknown) {
  ASSERT_TRUE(GiveLabel("red", 30).ok());
  request.mutable_prompt()->clear_view();
  request.mutable_prompt()->set_label("green");
  const grpc::Status status = Segment();
  EXPECT_EQ(status.error_code(), grpc::NOT_FOUND);
  EXPECT_NE(status.error_message().find("red"), std::string::npos) << status.error_message();
  request.mutable_prompt()->set_label("scenes/other/labels/red");
  ExpectRefused(Segment(), "prompt.label", "another scene");
  request.mutable_prompt()->set_label("red");
  request.mutable_prompt()->mutable_view()->set_view("middle.jpg");
  ExpectRefused(Segment(), "prompt.view", "its own view");
}

TEST_F(PromptsTest, ChoosesScaleAndThresholdThatAreAbsent) {
  auto* point = request.mutable_prompt()->mutable_points()->add_points();
  point->set_x(30);
  point->set_y(32);
  ASSERT_TRUE(Segment().ok());
  ExpectOnlyTheLeft();
  const double scale = answer.scale_quantile(), threshold = answer.threshold();
  request.mutable_granularity()->set_scale_quantile(scale);
  request.mutable_granularity()->set_threshold(threshold);
  const std::string counts = answer.masks(0).rle().counts();
  ASSERT_TRUE(Segment().ok());
  EXPECT_EQ(answer.masks(0).rle().counts(), counts);
  EXPECT_EQ(answer.threshold(), threshold);
}

TEST_F(PromptsTest, RefusesBadPromptsWithARemedy) {
  ExpectRefused(Segment(), "prompt", "no points, box, mask or label");
  v1::Prompt& prompt = *request.mutable_prompt();
  prompt.mutable_box()->set_x(500);
  prompt.mutable_box()->set_width(5);
  prompt.mutable_box()->set_height(5);
  grpc::Status status = Segment();
  EXPECT_EQ(status.error_code(), grpc::INVALID_ARGUMENT);
  EXPECT_NE(
      status.error_message().find("box 500,0 5x5 is outside photograph \"middle.jpg\" (96x64)"),
      std::string::npos);
  v1::CocoRle& rle = *prompt.mutable_mask()->mutable_rle();
  rle.set_width(kWidth);
  rle.set_height(kHeight);
  rle.set_counts(EncodeCocoRle({std::vector<uint8_t>(size_t{kWidth} * kHeight)}, kWidth, kHeight));
  status = Segment();
  EXPECT_EQ(status.error_code(), grpc::INVALID_ARGUMENT);
  EXPECT_NE(status.error_message().find("mask"), std::string::npos) << status.error_message();
  rle.set_width(kWidth - 1);
  EXPECT_EQ(Segment().error_code(), grpc::INVALID_ARGUMENT);
  request.mutable_granularity()->set_scale_quantile(7);
  EXPECT_EQ(Segment().error_code(), grpc::INVALID_ARGUMENT);
}

}  // namespace
}  // namespace pepeseg
