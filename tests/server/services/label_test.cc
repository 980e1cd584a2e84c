#include <gtest/gtest.h>

#include <algorithm>

#include "core/formats/encode_png.h"
#include "core/formats/rle.h"
#include "tests/server/shelf_model.h"

namespace pepeseg {
namespace {

// A scene with the model of model_worker.cc.
struct LabelTest : ::testing::Test {
  LabelTest() : running(PEPESEG_MODEL_WORKER) {
    running.CreateScene("shelf");
    const v1::Job job = running.Await(running.Train("shelf", "file").name());
    EXPECT_EQ(job.state(), v1::JOB_STATE_SUCCEEDED) << job.DebugString();
  }

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
    EXPECT_TRUE(png.ok()) << png.status();
    return png.ok() ? *png : "";
  }
  grpc::Status Create(const v1::CreateLabelRequest& request) {
    grpc::ClientContext context;
    label.Clear();
    return running.labels->CreateLabel(&context, request, &label);
  }
  grpc::Status Get(const std::string& name, v1::PixelFrame frame = v1::PIXEL_FRAME_UNSPECIFIED) {
    grpc::ClientContext context;
    v1::GetLabelRequest request;
    request.set_name(name);
    request.set_frame(frame);
    label.Clear();
    return running.labels->GetLabel(&context, request, &label);
  }
  grpc::Status List(const std::string& parent, int page_size, const std::string& token) {
    grpc::ClientContext context;
    v1::ListLabelsRequest request;
    request.set_parent(parent);
    request.set_page_size(page_size);
    request.set_page_token(token);
    list.Clear();
    return running.labels->ListLabels(&context, request, &list);
  }
  grpc::Status Delete(const std::string& name) {
    grpc::ClientContext context;
    v1::DeleteLabelRequest request;
    request.set_name(name);
    google::protobuf::Empty empty;
    return running.labels->DeleteLabel(&context, request, &empty);
  }
  void ExpectBadField(const v1::CreateLabelRequest& request, const std::string& field) {
    const grpc::Status status = Create(request);
    EXPECT_EQ(status.error_code(), grpc::INVALID_ARGUMENT) << field;
    EXPECT_EQ(DetailOf(status).field(), field) << status.error_message();
  }

  RunningServer running;
  v1::Label label;
  v1::ListLabelsResponse list;
};

TEST_F(LabelTest, ReturnsALabelWithItsMask) {
  const grpc::Status status = Create(Request("red"));
  ASSERT_TRUE(status.ok()) << status.error_message();
  EXPECT_EQ(label.name(), "scenes/shelf/labels/red");
  EXPECT_EQ(label.text(), "the red one");
  EXPECT_EQ(label.view(), "middle.jpg");
  EXPECT_EQ(label.area(), 400);
  EXPECT_TRUE(label.has_create_time());
  EXPECT_EQ(label.mask().rle().DebugString(), Request("red").label().mask().rle().DebugString());
}

TEST_F(LabelTest, GetsALabelWithItsMask) {
  ASSERT_TRUE(Create(Request("red")).ok());
  const v1::Label created = label;
  ASSERT_TRUE(Get("scenes/shelf/labels/red").ok());
  EXPECT_EQ(label.DebugString(), created.DebugString());
  ASSERT_TRUE(Get("scenes/shelf/labels/red", v1::PIXEL_FRAME_VIEW).ok());
  EXPECT_EQ(label.DebugString(), created.DebugString());
  const grpc::Status none = Get("scenes/shelf/labels/blue");
  EXPECT_EQ(none.error_code(), grpc::NOT_FOUND);
  EXPECT_EQ(DetailOf(none).reason(), "NO_SUCH_LABEL");
  EXPECT_EQ(DetailOf(none).resource(), "scenes/shelf/labels/blue");
  EXPECT_EQ(Get("scenes/none/labels/red").error_code(), grpc::NOT_FOUND);
  EXPECT_EQ(DetailOf(Get("red")).field(), "name");
  const auto unknown = static_cast<v1::PixelFrame>(7);
  EXPECT_EQ(DetailOf(Get("scenes/shelf/labels/red", unknown)).field(), "frame");
}

TEST_F(LabelTest, StoresAPngAsTheSameRle) {
  std::vector<uint8_t> pixels = Rectangle().pixels;
  for (uint8_t& pixel : pixels) pixel = pixel != 0 ? 7 : 0;  // any grey but black
  auto request = Request("red");
  request.mutable_label()->mutable_mask()->set_png(GreyPng(kWidth, kHeight, pixels));
  request.mutable_label()->clear_text();
  ASSERT_TRUE(Create(request).ok());
  EXPECT_EQ(label.mask().rle().counts(), Request("red").label().mask().rle().counts());
  EXPECT_EQ(label.text(), "red");
}

TEST_F(LabelTest, ListsLabelsWithoutMasksByPage) {
  for (const char* id : {"c", "a", "b"}) ASSERT_TRUE(Create(Request(id)).ok());
  ASSERT_TRUE(List("scenes/shelf", 2, "").ok());
  ASSERT_EQ(list.labels_size(), 2);
  EXPECT_EQ(list.labels(0).name(), "scenes/shelf/labels/a");
  EXPECT_EQ(list.labels(0).area(), 400);
  EXPECT_FALSE(list.labels(0).has_mask());
  ASSERT_TRUE(List("scenes/shelf", 2, list.next_page_token()).ok());
  ASSERT_EQ(list.labels_size(), 1);
  EXPECT_EQ(list.labels(0).name(), "scenes/shelf/labels/c");
  EXPECT_EQ(list.next_page_token(), "");
  EXPECT_EQ(List("scenes/shelf", -1, "").error_code(), grpc::INVALID_ARGUMENT);
  EXPECT_EQ(List("shelf", 0, "").error_code(), grpc::INVALID_ARGUMENT);
  EXPECT_EQ(List("scenes/none", 0, "").error_code(), grpc::NOT_FOUND);
}

TEST_F(LabelTest, DeletesALabelOnce) {
  ASSERT_TRUE(Create(Request("red")).ok());
  ASSERT_TRUE(Delete("scenes/shelf/labels/red").ok());
  const grpc::Status gone = Delete("scenes/shelf/labels/red");
  EXPECT_EQ(gone.error_code(), grpc::NOT_FOUND);
  EXPECT_EQ(DetailOf(gone).resource(), "scenes/shelf/labels/red");
  EXPECT_EQ(DetailOf(Delete("scenes/shelf/labels/_red")).field(), "name");
}

TEST_F(LabelTest, RefusesATakenIdButAcceptsARetry) {
  auto request = Request("red");
  request.set_request_id("r1");
  ASSERT_TRUE(Create(request).ok());
  EXPECT_TRUE(Create(request).ok());
  request.set_request_id("r2");
  const grpc::Status taken = Create(request);
  EXPECT_EQ(taken.error_code(), grpc::ALREADY_EXISTS);
  EXPECT_EQ(DetailOf(taken).resource(), "scenes/shelf/labels/red");
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
  ExpectBadField(Request("_no"), "label_id");
  auto request = Request("red");
  request.set_parent("shelf");
  ExpectBadField(request, "parent");
  request = Request("red");
  request.mutable_label()->set_text(std::string(257, 'x'));
  ExpectBadField(request, "label.text");
  request = Request("red");
  request.mutable_label()->set_view("nowhere.jpg");
  ExpectBadField(request, "label.view");
  request = Request("red");
  request.set_request_id(std::string(129, 'x'));
  ExpectBadField(request, "request_id");
  ASSERT_TRUE(List("scenes/shelf", 0, "").ok());
  EXPECT_EQ(list.labels_size(), 0);
}

TEST_F(LabelTest, NeedsASceneWithAModel) {
  auto request = Request("red");
  request.set_parent("scenes/none");
  EXPECT_EQ(Create(request).error_code(), grpc::NOT_FOUND);
  running.CreateScene("bare");
  request.set_parent("scenes/bare");
  const grpc::Status status = Create(request);
  EXPECT_EQ(status.error_code(), grpc::FAILED_PRECONDITION);
  EXPECT_EQ(DetailOf(status).reason(), "NO_MODEL");
}

}  // namespace
}  // namespace pepeseg
