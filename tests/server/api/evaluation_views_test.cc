#include "server/api/evaluation_views.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "server/api/request_image.h"
#include "server/store/error_detail.h"
#include "tests/testing/png_bytes.h"

namespace pepeseg {
namespace {

absl::Status Wanted() { return absl::OkStatus(); }

Model ModelOf(int num_views, int width, int height) {
  Model model;
  for (int v = 0; v < num_views; ++v) {
    ModelView& view = model.views.emplace_back();
    view.name = absl::StrCat(v, ".jpg");
    view.camera = {width, height, 100, 100, 50, 50};
    view.held_out = true;
  }
  return model;
}

// Returns a mask of those pixels at which a bit of y * width + x is set.
BinaryMask BitPlane(int width, int height, int bit) {
  BinaryMask mask;
  for (int i = 0; i < width * height; ++i) mask.pixels.push_back((i >> bit) & 1);
  return mask;
}

TEST(ReadTruthViews, LimitsThePixelsOfAllViewsTogether) {
  const Model model = ModelOf(3, 8000, 4000);
  v1::EvaluateModelRequest request;
  for (int v = 0; v < 2; ++v) request.add_views()->set_view(absl::StrCat(v, ".jpg"));
  EXPECT_TRUE(ReadTruthViews(request, model, Wanted).ok()) << "64 megapixels are allowed";
  request.add_views()->set_view("2.jpg");
  const absl::Status status = ReadTruthViews(request, model, Wanted).status();
  EXPECT_EQ(pepeseg::DetailOf(status).field, "views[2].view");
  EXPECT_TRUE(absl::StrContains(status.message(), "over 64000000 pixels")) << status;
}

// Masks that give each pixel another set of masks make a cell of each pixel.
TEST(ReadTruthViews, LimitsTheOverlapsOfMasks) {
  constexpr int kSide = 2048, kBits = 22;
  const Model model = ModelOf(1, kSide, kSide);
  v1::EvaluateModelRequest request;
  v1::ViewTruth& truth = *request.add_views();
  truth.set_view("0.jpg");
  const auto add = [&](const BinaryMask& mask) {
    v1::EntityMask& entity = *truth.add_masks();
    entity.set_entity(absl::StrCat(truth.masks_size()));
    *entity.mutable_mask()->mutable_rle() = RleToProto(mask, kSide, kSide);
  };
  for (int bit = 0; bit < kBits; ++bit) add(BitPlane(kSide, kSide, bit));
  BinaryMask pixel = {std::vector<uint8_t>(size_t{kSide} * kSide)};
  pixel.pixels[5] = 1;
  while (truth.masks_size() < 300) add(pixel);
  const absl::Status status = ReadTruthViews(request, model, Wanted).status();
  // 4 Mi cells have 32 MiB for each 64 masks: the fifth word is over 128 MiB.
  EXPECT_EQ(pepeseg::DetailOf(status).field, "views[0].masks[256]") << status;
  EXPECT_TRUE(absl::StrContains(status.message(), "overlaps")) << status;
}

TEST(ReadTruthViews, EndsWhenTheClientIsGone) {
  const Model model = ModelOf(2, 64, 64);
  v1::EvaluateModelRequest request;
  for (int v = 0; v < 2; ++v) request.add_views()->set_view(absl::StrCat(v, ".jpg"));
  int calls = 0;
  const auto status = ReadTruthViews(request, model, [&] {
                        return ++calls == 2 ? absl::CancelledError("gone") : absl::OkStatus();
                      }).status();
  EXPECT_TRUE(absl::IsCancelled(status));
}

// Returns a request for view 0.jpg, of 4x2 pixels, with a label image of 16 bits.
v1::EvaluateModelRequest LabelRequest(const std::vector<uint16_t>& ids) {
  std::string rows;
  for (size_t i = 0; i < ids.size(); ++i) {
    if (i % 4 == 0) rows += '\0';
    rows += static_cast<char>(ids[i] >> 8);
    rows += static_cast<char>(ids[i] & 0xff);
  }
  v1::EvaluateModelRequest request;
  v1::ViewTruth& truth = *request.add_views();
  truth.set_view("0.jpg");
  truth.set_labels_png(testing::GreyPng(4, 2, 16, rows));
  return request;
}

TEST(ReadTruthViews, TakesTheLabel255AsVoidOnlyNextToOthers) {
  const Model model = ModelOf(1, 4, 2);
  const std::vector<uint8_t> void_pixels = {0, 0, 1, 1, 0, 0, 0, 0};
  v1::EvaluateModelRequest request = LabelRequest({0, 3, 255, 255, 3, 0, 0, 7});
  auto views = ReadTruthViews(request, model, Wanted);
  ASSERT_TRUE(views.ok()) << views.status();
  EXPECT_EQ((*views)[0].entities, (std::vector<std::string>{"3", "7"}));
  EXPECT_EQ((*views)[0].ignore, void_pixels);
  EXPECT_EQ((*views)[0].num_void, 2);
  (*request.mutable_entity_names())[255] = "mug";
  views = ReadTruthViews(request, model, Wanted);
  ASSERT_TRUE(views.ok()) << views.status();
  EXPECT_EQ((*views)[0].entities, (std::vector<std::string>{"3", "7", "mug"}));
  EXPECT_TRUE((*views)[0].ignore.empty());
  views = ReadTruthViews(LabelRequest({0, 0, 255, 255, 0, 0, 0, 0}), model, Wanted);
  ASSERT_TRUE(views.ok()) << views.status();
  EXPECT_EQ((*views)[0].entities, std::vector<std::string>{"255"}) << "a binary mask";
  EXPECT_EQ((*views)[0].num_void, 0);
}

// The values of a soft border lie between those of its two sides.
TEST(ReadTruthViews, TakesABinaryMaskWithSoftBordersAsAnEntity) {
  constexpr int kSide = 16;
  std::string rows;
  for (int i = 0; i < kSide * kSide; ++i) {
    const int x = i % kSide;
    if (x == 0) rows += '\0';
    rows += static_cast<char>(std::clamp((x - 6) * 64, 0, 255));
  }
  v1::EvaluateModelRequest request;
  request.add_views()->set_view("0.jpg");
  request.mutable_views(0)->set_labels_png(testing::GreyPng(kSide, kSide, 8, rows));
  const auto views = ReadTruthViews(request, ModelOf(1, kSide, kSide), Wanted);
  ASSERT_TRUE(views.ok()) << views.status();
  EXPECT_TRUE((*views)[0].IndexOf("255"));
  EXPECT_EQ((*views)[0].num_void, 0);
}

TEST(ReadTruthViews, TakesTheIgnoreLabelAsVoidInsteadOf255) {
  const Model model = ModelOf(1, 4, 2);
  v1::EvaluateModelRequest request = LabelRequest({0, 3, 255, 255, 3, 0, 0, 7});
  request.set_ignore_label(3);
  const auto views = ReadTruthViews(request, model, Wanted);
  ASSERT_TRUE(views.ok()) << views.status();
  EXPECT_EQ((*views)[0].entities, (std::vector<std::string>{"7", "255"}));
  EXPECT_EQ((*views)[0].ignore, (std::vector<uint8_t>{0, 1, 0, 0, 1, 0, 0, 0}));
  EXPECT_EQ((*views)[0].num_void, 2);
  for (const int label : {-1, 0, 65'536}) {
    request.set_ignore_label(label);
    const absl::Status status = ReadTruthViews(request, model, Wanted).status();
    EXPECT_EQ(pepeseg::DetailOf(status).field, "ignore_label") << status;
  }
}

TEST(ReadSamViews, ReadsScoresOfTheMasksThatTheViewShows) {
  const Model model = ModelOf(1, 64, 64);
  v1::EvaluateModelRequest request;
  v1::SamViewMasks& sam = *request.add_sam_views();
  sam.set_view("0.jpg");
  for (const bool empty : {false, true, false}) {
    BinaryMask mask = BitPlane(64, 64, 3);
    if (empty) mask.pixels.assign(mask.pixels.size(), 0);
    *sam.add_masks()->mutable_mask()->mutable_rle() = RleToProto(mask, 64, 64);
  }
  sam.mutable_masks(1)->set_predicted_iou(0.1);
  sam.mutable_masks(2)->set_predicted_iou(0.9);
  sam.mutable_masks(2)->set_stability(0.8);
  const auto views = ReadSamViews(request, model, Wanted);
  ASSERT_TRUE(views.ok()) << views.status();
  ASSERT_EQ(views->size(), 1u);
  EXPECT_EQ((*views)[0].masks.num_masks, 2) << "equal masks stay, empty ones do not";
  EXPECT_EQ((*views)[0].predicted_iou, (std::vector<double>{1, 0.9}));
  EXPECT_EQ((*views)[0].stability, (std::vector<double>{1, 0.8}));
}

}  // namespace
}  // namespace pepeseg
