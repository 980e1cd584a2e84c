#include <gtest/gtest.h>

#include <algorithm>
#include <functional>

#include "core/formats/images.h"
#include "core/formats/rle.h"
#include "tests/server/shelf_model.h"

namespace pepeseg {
namespace {

struct LabelTest : ShelfModel {
  static BinaryMask Rectangle() {
    BinaryMask mask = {std::vector<uint8_t>(size_t{kWidth} * kHeight)};
    for (int y = 20; y < 30; ++y) {
      for (int x = 10; x < 50; ++x) mask.pixels[y * kWidth + x] = 1;
    }
    return mask;
  }
  static v1::CreateLabelRequest Request(const std::string& id) {
    v1::CreateLabelRequest request;
    request.set_parent("scenes/shelf");
    request.set_label_id(id);
    request.mutable_label()->set_text("the red one");
    request.mutable_label()->set_view("middle.jpg");
    v1::CocoRle& rle = *request.mutable_label()->mutable_mask()->mutable_rle();
    rle.set_width(kWidth);
    rle.set_height(kHeight);
    rle.set_counts(EncodeCocoRle(Rectangle(), kWidth, kHeight));
    return request;
  }
  static std::string GreyPng(int width, int height, const std::vector<uint8_t>& pixels) {
    const auto png = EncodePng(Image{width, height, 1, pixels});
    EXPECT_OK(png);
    return png.ok() ? *png : "";
  }
  Reply<v1::Label> Create(const v1::CreateLabelRequest& request) const {
    return Call(&LabelStub::CreateLabel, request);
  }
  Reply<v1::Label> Get(const std::string& name,
                       v1::PixelFrame frame = v1::PIXEL_FRAME_UNSPECIFIED) const {
    v1::GetLabelRequest request = Named{name};
    request.set_frame(frame);
    return Call(&LabelStub::GetLabel, request);
  }
  Reply<v1::ListLabelsResponse> List(const std::string& parent, int page_size,
                                     const std::string& token) const {
    v1::ListLabelsRequest request = Under{parent};
    request.set_page_size(page_size);
    request.set_page_token(token);
    return Call(&LabelStub::ListLabels, request);
  }
  grpc::Status Delete(const std::string& name) {
    return Call(&LabelStub::DeleteLabel, Named{name});
  }
  void ExpectBadField(const v1::CreateLabelRequest& request, const std::string& field) const {
    EXPECT_ERROR(Create(request), grpc::INVALID_ARGUMENT, field);
  }
};

TEST_F(LabelTest, ReturnsALabelWithItsMask) {
  ASSERT_OK_AND_ASSIGN(auto label, Create(Request("red")));
  EXPECT_EQ(label.name(), "scenes/shelf/labels/red");
  EXPECT_EQ(label.text(), "the red one");
  EXPECT_EQ(label.view(), "middle.jpg");
  EXPECT_EQ(label.area(), 400);
  EXPECT_TRUE(label.has_create_time());
  EXPECT_EQ(label.mask().rle().DebugString(), Request("red").label().mask().rle().DebugString());
}

TEST_F(LabelTest, GetsALabelWithItsMask) {
  const std::string created = Create(Request("red"))->DebugString();
  EXPECT_EQ(Get("scenes/shelf/labels/red")->DebugString(), created);
  EXPECT_EQ(Get("scenes/shelf/labels/red", v1::PIXEL_FRAME_VIEW)->DebugString(), created);
  EXPECT_ERROR(Get("scenes/shelf/labels/blue"), grpc::NOT_FOUND,
               {.reason = "NO_SUCH_LABEL", .resource = "scenes/shelf/labels/blue"});
  EXPECT_ERROR(Get("scenes/none/labels/red"), grpc::NOT_FOUND);
  EXPECT_ERROR(Get("red"), grpc::INVALID_ARGUMENT, "name");
  const auto unknown = static_cast<v1::PixelFrame>(7);
  EXPECT_ERROR(Get("scenes/shelf/labels/red", unknown), grpc::INVALID_ARGUMENT, "frame");
}

TEST_F(LabelTest, StoresAPngAsTheSameRle) {
  std::vector<uint8_t> pixels = Rectangle().pixels;
  for (uint8_t& pixel : pixels) pixel = pixel != 0 ? 7 : 0;  // any grey but black
  auto request = Request("red");
  request.mutable_label()->mutable_mask()->set_png(GreyPng(kWidth, kHeight, pixels));
  request.mutable_label()->clear_text();
  ASSERT_OK_AND_ASSIGN(auto label, Create(request));
  EXPECT_EQ(label.mask().rle().counts(), Request("red").label().mask().rle().counts());
  EXPECT_EQ(label.text(), "red");
}

TEST_F(LabelTest, ListsLabelsWithoutMasksByPage) {
  for (const char* id : {"c", "a", "b"}) ASSERT_OK(Create(Request(id)));
  ASSERT_OK_AND_ASSIGN(auto list, List("scenes/shelf", 2, ""));
  ASSERT_EQ(list.labels_size(), 2);
  EXPECT_EQ(list.labels(0).name(), "scenes/shelf/labels/a");
  EXPECT_EQ(list.labels(0).area(), 400);
  EXPECT_FALSE(list.labels(0).has_mask());
  ASSERT_OK_AND_ASSIGN(list, List("scenes/shelf", 2, list.next_page_token()));
  ASSERT_EQ(list.labels_size(), 1);
  EXPECT_EQ(list.labels(0).name(), "scenes/shelf/labels/c");
  EXPECT_EQ(list.next_page_token(), "");
  EXPECT_ERROR(List("scenes/shelf", -1, ""), grpc::INVALID_ARGUMENT);
  EXPECT_ERROR(List("shelf", 0, ""), grpc::INVALID_ARGUMENT);
  EXPECT_ERROR(List("scenes/none", 0, ""), grpc::NOT_FOUND);
}

TEST_F(LabelTest, DeletesALabelOnce) {
  ASSERT_OK(Create(Request("red")));
  ASSERT_OK(Delete("scenes/shelf/labels/red"));
  EXPECT_ERROR(Delete("scenes/shelf/labels/red"), grpc::NOT_FOUND,
               {.resource = "scenes/shelf/labels/red"});
  EXPECT_ERROR(Delete("scenes/shelf/labels/_red"), grpc::INVALID_ARGUMENT, "name");
}

TEST_F(LabelTest, RefusesATakenIdButAcceptsARetry) {
  auto request = Request("red");
  request.set_request_id("r1");
  ASSERT_OK(Create(request));
  EXPECT_OK(Create(request));
  request.set_request_id("r2");
  EXPECT_ERROR(Create(request), grpc::ALREADY_EXISTS, {.resource = "scenes/shelf/labels/red"});
}

TEST_F(LabelTest, RefusesMasksThatDoNotFitTheView) {
  auto request = Request("red");
  v1::MaskImage& mask = *request.mutable_label()->mutable_mask();
  mask.mutable_rle()->set_width(kWidth - 1);
  ExpectBadField(request, "label.mask.rle");
  mask.mutable_rle()->set_width(kWidth);
  mask.mutable_rle()->set_counts("\x01");
  ExpectBadField(request, "label.mask.rle.counts");
  mask.mutable_rle()->set_counts("1");
  ExpectBadField(request, "label.mask.rle.counts");
  const BinaryMask empty = {std::vector<uint8_t>(size_t{kWidth} * kHeight)};
  mask.mutable_rle()->set_counts(EncodeCocoRle(empty, kWidth, kHeight));
  ExpectBadField(request, "label.mask");
  mask.set_png(GreyPng(kHeight, kWidth, empty.pixels));
  ExpectBadField(request, "label.mask.png");
  mask.set_png(GreyPng(kWidth, kHeight, empty.pixels));
  ExpectBadField(request, "label.mask");
  mask.set_png(GreyPng(kWidth, kHeight, Rectangle().pixels).substr(0, 60));
  ExpectBadField(request, "label.mask.png");
  mask.set_png(std::string((size_t{4} << 20) + 1, 'x'));
  ExpectBadField(request, "label.mask.png");
  mask.clear_image();
  ExpectBadField(request, "label.mask");
}

TEST_F(LabelTest, RefusesOtherBadFields) {
  using Change = std::function<void(v1::CreateLabelRequest&)>;
  const std::vector<std::pair<std::string, Change>> cases = {
      {"label_id", [](auto& request) { request.set_label_id("_no"); }},
      {"parent", [](auto& request) { request.set_parent("shelf"); }},
      {"label.text",
       [](auto& request) { request.mutable_label()->set_text(std::string(257, 'x')); }},
      {"label.view", [](auto& request) { request.mutable_label()->set_view("nowhere.jpg"); }},
      {"request_id", [](auto& request) { request.set_request_id(std::string(129, 'x')); }}};
  for (const auto& [field, change] : cases) {
    auto request = Request("red");
    change(request);
    ExpectBadField(request, field);
  }
  EXPECT_EQ(List("scenes/shelf", 0, "")->labels_size(), 0);
}

TEST_F(LabelTest, NeedsASceneWithAModel) {
  auto request = Request("red");
  request.set_parent("scenes/none");
  EXPECT_ERROR(Create(request), grpc::NOT_FOUND);
  running.CreateScene("bare");
  request.set_parent("scenes/bare");
  EXPECT_ERROR(Create(request), grpc::FAILED_PRECONDITION, {.reason = "NO_MODEL"});
}

}  // namespace
}  // namespace pepeseg
