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
  Reply<v1::SegmentViewsResponse> Segment() const {
    return Call(&SegmentationStub::SegmentViews, request);
  }
  // The mask that a click selects.
  v1::CocoRle MaskAt(double x) const {
    const v1::SegmentViewsResponse response =
        *Call(&SegmentationStub::SegmentViews, Click<v1::SegmentViewsRequest>(x));
    return response.masks_size() == 1 ? response.masks(0).rle() : v1::CocoRle();
  }
  grpc::Status GiveLabel(const std::string& id, double x) const {
    v1::CreateLabelRequest create = Under{"scenes/shelf"};
    create.set_label_id(id);
    create.mutable_label()->set_view("middle.jpg");
    *create.mutable_label()->mutable_mask()->mutable_rle() = MaskAt(x);
    return Call(&LabelStub::CreateLabel, create);
  }
  static void ExpectOnlyTheLeft(const v1::SegmentViewsResponse& answer) {
    ASSERT_EQ(answer.masks_size(), 1);
    EXPECT_GT(answer.masks(0).area(), 700);
    EXPECT_LT(answer.masks(0).box().x() + answer.masks(0).box().width(), 52);
  }

  v1::SegmentViewsRequest request;
};

TEST_F(PromptsTest, FindsWhatFillsABox) {
  v1::BoxPrompt& box = *request.mutable_prompt()->mutable_box();
  box.set_x(14), box.set_y(16), box.set_width(32), box.set_height(32);
  ExpectOnlyTheLeft(*Segment());
}

TEST_F(PromptsTest, CorrectsAPreviousMask) {
  *request.mutable_prompt() = Click<v1::SegmentViewsRequest>(66).prompt();
  v1::PointsPrompt& points = *request.mutable_prompt()->mutable_points();
  points.mutable_points(0)->set_negative(true);
  EXPECT_ERROR(Segment(), grpc::INVALID_ARGUMENT, {.field = "prompt.points.points"});
  // Both squares are one mask, of which the right one is wrong.
  v1::SegmentViewsRequest both = Click<v1::SegmentViewsRequest>(30);
  both.mutable_granularity()->set_scale_quantile(1);
  *points.mutable_previous_mask()->mutable_rle() =
      Call(&SegmentationStub::SegmentViews, both)->masks(0).rle();
  ExpectOnlyTheLeft(*Segment());
  points.mutable_previous_mask()->mutable_rle()->set_width(7);
  EXPECT_ERROR(Segment(), grpc::INVALID_ARGUMENT, {.field = "prompt.points.previous_mask.rle"});
}

TEST_F(PromptsTest, FindsWhatIsScribbledOver) {
  v1::ScribblesPrompt& scribbles = *request.mutable_prompt()->mutable_scribbles();
  const auto add = [&](double from, double to) -> v1::ScribblesPrompt::Stroke& {
    v1::ScribblesPrompt::Stroke& stroke = *scribbles.add_strokes();
    for (const double x : {from, to}) {
      stroke.add_path()->set_x(x);
      stroke.mutable_path()->rbegin()->set_y(32);
    }
    return stroke;
  };
  add(24, 36).set_width(3);
  ExpectOnlyTheLeft(*Segment());
  add(60, 72).set_negative(true);
  ExpectOnlyTheLeft(*Segment());
  add(36, 96);
  EXPECT_ERROR(Segment(), grpc::INVALID_ARGUMENT, "prompt.scribbles.strokes[2].path[1]",
               "point 96,32 is outside photograph \"middle.jpg\" (96x64)");
  // Strokes as images: only the positive ones must be there.
  scribbles.clear_strokes();
  *scribbles.mutable_negative()->mutable_rle() = MaskAt(66);
  EXPECT_ERROR(Segment(), grpc::INVALID_ARGUMENT, "prompt.scribbles", "no positive stroke");
  *scribbles.mutable_positive()->mutable_rle() = MaskAt(30);
  ExpectOnlyTheLeft(*Segment());
}

TEST_F(PromptsTest, FindsTheMeanOfPoints) {
  for (const double x : {28, 32}) {
    v1::PointsPrompt::Point& point = *request.mutable_prompt()->mutable_point_mean()->add_points();
    point.set_x(x);
    point.set_y(32);
  }
  ExpectOnlyTheLeft(*Segment());
}

TEST_F(PromptsTest, FindsAMaskInAnotherView) {
  *request.mutable_prompt()->mutable_mask()->mutable_rle() = MaskAt(30);
  request.mutable_targets()->add_views("right.jpg");
  ASSERT_OK_AND_ASSIGN(auto answer, Segment());
  EXPECT_EQ(answer.masks(0).view(), "right.jpg");
  ExpectOnlyTheLeft(answer);
}

TEST_F(PromptsTest, FindsALabelByItsIdAndByItsName) {
  ASSERT_OK(GiveLabel("red", 30));
  request.mutable_prompt()->clear_view();
  for (const std::string label : {"red", "scenes/shelf/labels/red"}) {
    request.mutable_prompt()->set_label(label);
    ASSERT_OK_AND_ASSIGN(auto answer, Segment());
    EXPECT_EQ(answer.masks(0).view(), "middle.jpg");  // its own, where no targets are named
    ExpectOnlyTheLeft(answer);
  }
  request.mutable_targets()->set_group(v1::SegmentViewsRequest::Targets::GROUP_ALL);
  EXPECT_EQ(Segment()->masks_size(), 3);
}

TEST_F(PromptsTest, ListsTheLabelsIfALabelIsUnknown) {
  ASSERT_OK(GiveLabel("red", 30));
  request.mutable_prompt()->clear_view();
  request.mutable_prompt()->set_label("green");
  EXPECT_ERROR(Segment(), grpc::NOT_FOUND, {.message = "red"});
  request.mutable_prompt()->set_label("scenes/other/labels/red");
  EXPECT_ERROR(Segment(), grpc::INVALID_ARGUMENT, "prompt.label", "another scene");
  request.mutable_prompt()->set_label("red");
  request.mutable_prompt()->mutable_view()->set_view("middle.jpg");
  EXPECT_ERROR(Segment(), grpc::INVALID_ARGUMENT, "prompt.view", "its own view");
}

TEST_F(PromptsTest, ChoosesScaleAndThresholdThatAreAbsent) {
  auto* point = request.mutable_prompt()->mutable_points()->add_points();
  point->set_x(30);
  point->set_y(32);
  ASSERT_OK_AND_ASSIGN(auto answer, Segment());
  ExpectOnlyTheLeft(answer);
  const double scale = answer.scale_quantile(), threshold = answer.threshold();
  request.mutable_granularity()->set_scale_quantile(scale);
  request.mutable_granularity()->set_threshold(threshold);
  const std::string counts = answer.masks(0).rle().counts();
  ASSERT_OK_AND_ASSIGN(answer, Segment());
  EXPECT_EQ(answer.masks(0).rle().counts(), counts);
  EXPECT_EQ(answer.threshold(), threshold);
}

TEST_F(PromptsTest, RefusesBadPromptsWithARemedy) {
  EXPECT_ERROR(Segment(), grpc::INVALID_ARGUMENT, "prompt",
               "no points, box, mask, scribbles, point_mean or label");
  v1::Prompt& prompt = *request.mutable_prompt();
  prompt.mutable_box()->set_x(500);
  prompt.mutable_box()->set_width(5);
  prompt.mutable_box()->set_height(5);
  grpc::Status status = Segment();
  EXPECT_ERROR(status, grpc::INVALID_ARGUMENT,
               {.message = "box 500,0 5x5 is outside photograph \"middle.jpg\" (96x64)"});
  v1::CocoRle& rle = *prompt.mutable_mask()->mutable_rle();
  rle.set_width(kWidth);
  rle.set_height(kHeight);
  rle.set_counts(EncodeCocoRle({std::vector<uint8_t>(size_t{kWidth} * kHeight)}, kWidth, kHeight));
  EXPECT_ERROR(Segment(), grpc::INVALID_ARGUMENT, {.message = "mask"});
  rle.set_width(kWidth - 1);
  EXPECT_ERROR(Segment(), grpc::INVALID_ARGUMENT);
  request.mutable_granularity()->set_scale_quantile(7);
  EXPECT_ERROR(Segment(), grpc::INVALID_ARGUMENT);
}

}  // namespace
}  // namespace pepeseg
