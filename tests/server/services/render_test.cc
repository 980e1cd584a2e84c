#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <limits>

#include "core/formats/images.h"
#include "core/formats/rle.h"
#include "tests/server/shelf_model.h"

namespace pepeseg {
namespace {

using Request = v1::RenderViewRequest;

constexpr int kInRed = 32 * kWidth + 30, kInBlue = 32 * kWidth + 66, kNothing = 2 * kWidth + 2;

struct RenderTest : ShelfModel {
  RenderTest() {
    request.set_model(kModel);
    request.mutable_viewpoint()->set_view("middle.jpg");
  }
  Reply<v1::RenderViewResponse> Render() const { return Call(&RenderStub::RenderView, request); }
  // Returns the pixels of a 16-bit answer, [height, width].
  std::vector<float> Grey() {
    answer = *Render();
    const std::span png(reinterpret_cast<const uint8_t*>(answer.png().data()), answer.png().size());
    const auto image = DecodeGrey(png, "picture");
    EXPECT_OK(image);
    if (!image.ok() || image->values.size() != size_t{kWidth} * kHeight) {
      ADD_FAILURE() << "a picture of " << image->width << "x" << image->height;
      return std::vector<float>(size_t{kWidth} * kHeight);
    }
    return image->values;
  }
  Image Colors() {
    answer = *Render();
    const auto path = running.folder / "picture.png";
    std::ofstream(path, std::ios::binary) << answer.png();
    const auto image = DecodePhoto(path, "picture.png");
    EXPECT_OK(image);
    if (!image.ok() || image->pixels.size() != size_t{3} * kWidth * kHeight) {
      ADD_FAILURE() << "a picture of " << image->width << "x" << image->height;
      return {kWidth, kHeight, 3, std::vector<uint8_t>(size_t{3} * kWidth * kHeight)};
    }
    return *image;
  }
  void ExpectRenderRefused(const std::string& field, const std::string& words) {
    EXPECT_ERROR(Render(), grpc::INVALID_ARGUMENT, field, words);
  }

  Request request;
  v1::RenderViewResponse answer;  // of the last Grey() or Colors()
};

bool IsRed(const uint8_t* rgb) { return rgb[0] > 200 && rgb[2] < 60; }
bool IsBlue(const uint8_t* rgb) { return rgb[2] > 200 && rgb[0] < 60; }
bool IsBlack(const uint8_t* rgb) { return rgb[0] + rgb[1] + rgb[2] < 30; }
const uint8_t* At(const Image& image, int pixel) { return &image.pixels[3 * pixel]; }

TEST_F(RenderTest, ReturnsDepthInTheAnswersUnits) {
  request.set_content(Request::CONTENT_DEPTH);
  const std::vector<float> depth = Grey();
  EXPECT_GT(answer.depth_unit(), 0);
  EXPECT_NEAR(depth[kInRed] * answer.depth_unit(), 2, 0.01);
  EXPECT_NEAR(depth[kInBlue] * answer.depth_unit(), 2, 0.01);
  EXPECT_EQ(depth[kNothing], 0);
  SetSegment(0, 1, *request.mutable_subset());
  const std::vector<float> red_only = Grey();
  EXPECT_NEAR(red_only[kInRed] * answer.depth_unit(), 2, 0.01);
  EXPECT_EQ(red_only[kInBlue], 0);
}

TEST_F(RenderTest, KeepsIdsOfSegmentsInAllViews) {
  request.set_content(Request::CONTENT_SEGMENTS);
  request.set_level(1);
  for (const auto& [view, shift] : {std::pair("middle.jpg", 0), std::pair("right.jpg", -3)}) {
    request.mutable_viewpoint()->set_view(view);
    const std::vector<float> ids = Grey();
    EXPECT_EQ(ids[kInRed + shift], 1) << view;
    EXPECT_EQ(ids[kInBlue + shift], 2) << view;
    EXPECT_EQ(ids[kNothing], 0) << view;
  }
  EXPECT_EQ(answer.width(), kWidth);
  EXPECT_EQ(answer.height(), kHeight);
}

TEST_F(RenderTest, KeepsColoursOfFeaturesInAllViews) {
  request.set_content(Request::CONTENT_FEATURES);
  request.set_feature_scale(0.5);
  const Image middle = Colors();
  EXPECT_TRUE(IsBlack(At(middle, kNothing)));
  EXPECT_GT(std::abs(At(middle, kInRed)[0] - At(middle, kInBlue)[0]), 200);
  request.mutable_viewpoint()->set_view("right.jpg");
  const Image right = Colors();
  for (int k = 0; k < 3; ++k) {
    EXPECT_NEAR(At(right, kInRed - 3)[k], At(middle, kInRed)[k], 2);
    EXPECT_NEAR(At(right, kInBlue - 3)[k], At(middle, kInBlue)[k], 2);
  }
}

TEST_F(RenderTest, RendersASegmentAloneAndAllWithoutIt) {
  SetSegment(2, 1, *request.mutable_subset());
  const Image alone = Colors();
  EXPECT_TRUE(IsRed(At(alone, kInRed)));
  EXPECT_TRUE(IsBlack(At(alone, kInBlue)));
  request.mutable_subset()->set_complement(true);
  const Image without = Colors();
  EXPECT_TRUE(IsBlack(At(without, kInRed)));
  EXPECT_TRUE(IsBlue(At(without, kInBlue)));
  request.clear_subset();
  const Image all = Colors();
  EXPECT_TRUE(IsRed(At(all, kInRed)) && IsBlue(At(all, kInBlue)));
}

TEST_F(RenderTest, TintsAnOverlayAndDrawsItsBorder) {
  const Image plain = Colors();
  BinaryMask mask = {std::vector<uint8_t>(kWidth * kHeight)};
  for (int y = 10; y < 20; ++y) {
    for (int x = 40; x < 60; ++x) mask.pixels[y * kWidth + x] = 1;
  }
  v1::CocoRle& rle = *request.mutable_overlay_mask()->mutable_rle();
  rle.set_width(kWidth);
  rle.set_height(kHeight);
  rle.set_counts(EncodeCocoRle(mask, kWidth, kHeight));
  const Image with_mask = Colors();
  const int inside = 15 * kWidth + 48, border = 10 * kWidth + 48, outside = 9 * kWidth + 48;
  EXPECT_NEAR(At(with_mask, inside)[0], 0.55 * At(plain, inside)[0] + 0.45 * 255, 1);
  EXPECT_EQ(At(with_mask, border)[0], 255);
  EXPECT_EQ(At(with_mask, border)[1], 120);
  EXPECT_EQ(At(with_mask, outside)[0], At(plain, outside)[0]);
  for (uint8_t& pixel : mask.pixels) pixel = pixel != 0 ? 255 : 0;
  ASSERT_OK_AND_ASSIGN(const auto png, EncodePng(Image{kWidth, kHeight, 1, mask.pixels}));
  request.mutable_overlay_mask()->set_png(png);
  EXPECT_EQ(Colors().pixels, with_mask.pixels) << "a PNG says the same as runs";
}

TEST_F(RenderTest, DrawsAnOverlayOfASegmentWhereItIsSeen) {
  const Image plain = Colors();
  SetSegment(0, 2, *request.mutable_overlay_subset());
  const Image image = Colors();
  EXPECT_NEAR(At(image, kInBlue)[0], 0.55 * At(plain, kInBlue)[0] + 0.45 * 255, 1);
  EXPECT_EQ(At(image, kInRed)[2], At(plain, kInRed)[2]);
  EXPECT_EQ(At(image, kNothing)[0], At(plain, kNothing)[0]);
  SetSegment(0, 1, *request.mutable_subset());
  EXPECT_TRUE(IsBlack(At(Colors(), kInBlue))) << "what is not rendered has no overlay";
}

TEST_F(RenderTest, RefusesInvalidContents) {
  request.set_content(static_cast<Request::Content>(9));
  ExpectRenderRefused("content", "'9': no content");
  request.set_content(Request::CONTENT_SEGMENTS);
  request.set_level(3);
  ExpectRenderRefused("level", "'3': no level of 3");
  request.set_level(-1);
  ExpectRenderRefused("level", "'-1'");
  request.add_decomposition_scales(0.5);
  request.add_decomposition_scales(0.1);
  ExpectRenderRefused("decomposition_scales[1]", "not over the scale before");
  request.set_content(Request::CONTENT_FEATURES);
  for (const double scale : {-0.1, 1.1, std::numeric_limits<double>::quiet_NaN()}) {
    request.set_feature_scale(scale);
    ExpectRenderRefused("feature_scale", "not in [0, 1]");
  }
  request.set_feature_scale(0.5);
  SetSegment(0, 1, *request.mutable_overlay_subset());
  ExpectRenderRefused("overlay", "only CONTENT_COLOR has an overlay");
}

TEST_F(RenderTest, RefusesViewsThatTheModelDoesNotHave) {
  request.mutable_viewpoint()->set_view("nowhere.jpg");
  EXPECT_ERROR(Render(), grpc::INVALID_ARGUMENT);
  request.clear_viewpoint();
  EXPECT_ERROR(Render(), grpc::INVALID_ARGUMENT);
}

TEST_F(RenderTest, RefusesInvalidSubsets) {
  SetSegment(0, 3, *request.mutable_subset());
  ExpectRenderRefused("subset.segment.id", "level 0 has 2");
  SetSegment(0, 0, *request.mutable_subset());
  ExpectRenderRefused("subset.segment.id", "'0': no segment");
  SetSegment(5, 1, *request.mutable_subset());
  ExpectRenderRefused("subset.segment.level", "'5': no level of 3");
  request.mutable_subset()->mutable_segment()->add_scales(7);
  ExpectRenderRefused("subset.segment.scales[0]", "not in [0, 1]");
  request.mutable_subset()->set_selection("nonsense");
  ExpectRenderRefused("subset.selection", "nonsense");
  request.mutable_subset()->clear_selection();
  request.mutable_subset()->set_complement(true);
  ExpectRenderRefused("subset.complement", "of neither a selection nor a segment");
}

TEST_F(RenderTest, RefusesOverlaysThatDoNotFit) {
  v1::CocoRle& rle = *request.mutable_overlay_mask()->mutable_rle();
  rle.set_width(10);
  rle.set_height(10);
  ExpectRenderRefused("overlay_mask.rle", "10x10");
  request.mutable_overlay_mask()->set_png("no picture");
  ExpectRenderRefused("overlay_mask.png", "not a whole PNG");
  request.mutable_overlay_mask()->clear_png();
  ExpectRenderRefused("overlay_mask", "neither RLE nor PNG");
  SetSegment(0, 9, *request.mutable_overlay_subset());
  ExpectRenderRefused("overlay_subset.segment.id", "'9': no segment");
  request.mutable_overlay_subset()->Clear();
  ExpectRenderRefused("overlay_subset", "neither a selection nor a segment");
}

}  // namespace
}  // namespace pepeseg
