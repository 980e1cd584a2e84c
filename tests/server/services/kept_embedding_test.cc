#include "server/services/kept_embedding.h"

#include <gtest/gtest.h>

#include <array>
#include <memory>
#include <utility>

#include "core/base/digest.h"
#include "core/query/scene_model.h"
#include "tests/testing/fake_sam.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

// Returns the mask with its border as SAM sees it in the photograph of the embedding.
absl::StatusOr<BinaryMask> Refined(const SamBorders& sam, const SamEmbedding& embedding,
                                   const ModelView& view, const BinaryMask& mask) {
  return PhotographSam{sam, embedding, view, true}.Refine(mask, {});
}

// A photograph with a red square on blue, and a fake of SAM, which segments by colour in cells of 8
// pixels.
struct KeptEmbeddingTest : ::testing::Test {
  static constexpr int kPhotoWidth = 512, kPhotoHeight = 384;

  KeptEmbeddingTest() {
    testing::MakeFakeSam(folder / "sam");
    auto opened = SamBorders::Open(folder / "sam", {});
    EXPECT_OK(opened);
    sam = *std::move(opened);
    origin = {sam->encoder_digest(), Sha256Hex("the photograph")};
    view.name = "a/1.jpg";
    Lens lens;
    lens.model = LensModel::kSimpleRadial;
    lens.width = kPhotoWidth, lens.height = kPhotoHeight;
    lens.fx = lens.fy = 400, lens.cx = 256, lens.cy = 192;
    lens.distortion[0] = 0.1;
    view.photograph = Photograph{lens, 1, 16, 12, 480, 360};
    view.camera = {.width = 480, .height = 360, .fx = 400, .fy = 400, .cx = 240, .cy = 180};
  }
  static bool InSquare(double x, double y, double margin) {
    return x >= 128 - margin && x < 320 + margin && y >= 96 - margin && y < 288 + margin;
  }
  SamEmbedding Embedded(int width, int height) const {
    Image image{width, height, 3, {}};
    for (int i = 0; i < width * height; ++i) {
      const double scale = static_cast<double>(kPhotoWidth) / width;
      const bool red = InSquare((i % width + 0.5) * scale, (i / width + 0.5) * scale, 0);
      for (const int value : {red ? 250 : 0, 0, red ? 0 : 250}) {
        image.pixels.push_back(static_cast<uint8_t>(value));
      }
    }
    return sam->Embed(image).value();
  }
  // Returns the view's mask of the square and `margin` pixels of the photograph around it.
  BinaryMask MaskInView(double margin) const {
    const Frame frame(view);
    BinaryMask mask;
    for (int i = 0; i < view.camera.width * view.camera.height; ++i) {
      const Eigen::Vector2d place = frame.FromView(Eigen::Vector2d(
          i % view.camera.width + 0.5, static_cast<double>(i / view.camera.width) + 0.5));
      mask.pixels.push_back(InSquare(place.x(), place.y(), margin) ? 1 : 0);
    }
    return mask;
  }
  static double Iou(const BinaryMask& a, const BinaryMask& b) {
    double common = 0, united = 0;
    for (size_t i = 0; i < a.pixels.size(); ++i) {
      common += a.pixels[i] & b.pixels[i];
      united += a.pixels[i] | b.pixels[i];
    }
    return common / united;
  }

  testing::TempFolder folder;
  std::unique_ptr<SamBorders> sam;
  EmbeddingOrigin origin;
  ModelView view;
};

// The photograph is turned and distorted, and was shrunk or not.
TEST_F(KeptEmbeddingTest, PlacesBordersOfWarpedViews) {
  const BinaryMask truth = MaskInView(0);
  for (const int width : {512, 400}) {
    const SamEmbedding embedding = Embedded(width, width * 3 / 4);
    for (const double margin : {-6.0, 6.0}) {
      const BinaryMask mask = MaskInView(margin);
      EXPECT_LT(Iou(mask, truth), 0.95);
      ASSERT_OK_AND_ASSIGN(const BinaryMask refined, Refined(*sam, embedding, view, mask));
      EXPECT_GT(Iou(refined, truth), 0.985) << width << " " << margin;
    }
    ASSERT_OK_AND_ASSIGN(const BinaryMask same, Refined(*sam, embedding, view, truth));
    EXPECT_GT(Iou(same, truth), 0.99) << width;
  }
}

TEST_F(KeptEmbeddingTest, PlacesBordersOfTurnedViews) {
  view.photograph->lens = MakeLens(LensModel::kSimplePinhole, kPhotoHeight, kPhotoWidth,
                                   std::array<double, 3>{400, 192, 256}.data());
  view.photograph->orientation = 6;
  view.photograph->left = view.photograph->top = 0;
  view.photograph->width = kPhotoHeight, view.photograph->height = kPhotoWidth;
  view.camera = {.width = 384, .height = 512, .fx = 400, .fy = 400, .cx = 192, .cy = 256};
  const BinaryMask truth = MaskInView(0);
  ASSERT_OK_AND_ASSIGN(const BinaryMask refined,
                       Refined(*sam, Embedded(512, 384), view, MaskInView(6)));
  EXPECT_GT(Iou(refined, truth), 0.985);
}

TEST_F(KeptEmbeddingTest, AnswersClicksInWarpedViews) {
  const BinaryMask truth = MaskInView(0);
  for (const int width : {512, 400}) {
    const SamEmbedding embedding = Embedded(width, width * 3 / 4);
    const PhotographSam in = {*sam, embedding, view, true};
    const Eigen::Vector2d middle = *Frame(view).ToView(Eigen::Vector2d(224, 192));
    const std::array<PointPrompt, 1> click = {PointPrompt{middle.x(), middle.y(), true}};
    ASSERT_OK_AND_ASSIGN(const auto masks, in.Click(click, nullptr));
    ASSERT_EQ(masks.size(), 3U);
    double best = 0;
    for (const SoftMask& mask : masks) best = std::max(best, Iou(mask.mask, truth));
    EXPECT_GT(best, 0.95) << width;
    ASSERT_OK_AND_ASSIGN(const auto next, in.Click(click, &masks[0]));
    EXPECT_EQ(next.size(), 4U);  // changed, and of three sizes
  }
}

TEST_F(KeptEmbeddingTest, AnswersBoxesInWarpedViews) {
  const BinaryMask truth = MaskInView(0);
  int box[4];
  FindBox(truth.pixels, view.camera.width, box);
  const SamEmbedding embedding = Embedded(400, 300);
  const PhotographSam in = {*sam, embedding, view, true};
  ASSERT_OK_AND_ASSIGN(const auto masks,
                       in.Box({double(box[0]), double(box[1]), double(box[2]), double(box[3])}));
  ASSERT_EQ(masks.size(), 4U);
  double best = 0;
  for (const SoftMask& mask : masks) best = std::max(best, Iou(mask.mask, truth));
  EXPECT_GT(best, 0.95);
}

// Not resampled: the answer is that of the network itself.
TEST_F(KeptEmbeddingTest, LeavesMasksOfShrunkViewsInTheirPixels) {
  view.photograph->lens.model = LensModel::kPinhole;
  view.photograph->lens.distortion = {};
  view.photograph->left = view.photograph->top = 0;
  view.photograph->width = kPhotoWidth, view.photograph->height = kPhotoHeight;
  view.camera = {.width = 256, .height = 192, .fx = 200, .fy = 200, .cx = 128, .cy = 96};
  const SamEmbedding embedding = Embedded(256, 192);
  const BinaryMask mask = MaskInView(6);
  ASSERT_OK_AND_ASSIGN(const BinaryMask want, sam->Refine(embedding, mask));
  ASSERT_OK_AND_ASSIGN(const BinaryMask got, Refined(*sam, embedding, view, mask));
  EXPECT_EQ(got.pixels, want.pixels);
  EXPECT_NE(got.pixels, mask.pixels);
}

TEST_F(KeptEmbeddingTest, IsReadForThePhotographOfItsView) {
  const auto write = [&](const SamEmbedding& embedding) {
    ASSERT_OK(WriteEmbedding(folder.path() / EmbeddingFileName(view.name), embedding, origin));
  };
  const auto error = [&] { return ReadKeptEmbedding(folder.path(), view, origin).status(); };
  EXPECT_TRUE(absl::IsNotFound(error()));
  write(Embedded(512, 384));
  EXPECT_OK(error());
  write(Embedded(101, 76));  // each side is rounded
  EXPECT_OK(error());
  write(Embedded(384, 512));
  EXPECT_TRUE(absl::IsDataLoss(error()));
}

}  // namespace
}  // namespace pepeseg
