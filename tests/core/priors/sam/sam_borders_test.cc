#include "core/priors/sam/sam_borders.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <ctime>
#include <functional>
#include <string>

#include "core/dataset/import.h"
#include "core/priors/sam/sam_embedding.h"
#include "tests/testing/fake_sam.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

constexpr int kPhotoWidth = 512, kPhotoHeight = 384;

BinaryMask MaskWhere(const std::function<bool(int x, int y)>& inside) {
  BinaryMask mask;
  for (int i = 0; i < kPhotoWidth * kPhotoHeight; ++i) {
    mask.pixels.push_back(inside(i % kPhotoWidth, i / kPhotoWidth) ? 1 : 0);
  }
  return mask;
}

double Iou(const BinaryMask& a, const BinaryMask& b) {
  double common = 0, united = 0;
  for (size_t i = 0; i < a.pixels.size(); ++i) {
    common += a.pixels[i] & b.pixels[i];
    united += a.pixels[i] | b.pixels[i];
  }
  return common / united;
}

// The image has a red square on blue. The fake network segments by the colour of the first point,
// in cells of 8 pixels of this image.
class SamBordersTest : public ::testing::Test {
 protected:
  static bool InSquare(int x, int y, int margin) {
    return x >= 128 - margin && x < 320 + margin && y >= 96 - margin && y < 288 + margin;
  }
  SamBordersTest()
      : folder_path_(folder_ / "sam"),
        square_(MaskWhere([](int x, int y) { return InSquare(x, y, 0); })) {
    testing::MakeFakeSam(folder_path_);
    image_ = {kPhotoWidth, kPhotoHeight, 3, {}};
    for (const uint8_t red : square_.pixels) {
      for (const int value : {red * 250, 0, (1 - red) * 250}) {
        image_.pixels.push_back(static_cast<uint8_t>(value));
      }
    }
  }
  BinaryMask Refined(const BinaryMask& mask) {
    const auto borders = SamBorders::Open(folder_path_, {});
    if (!borders.ok()) return {};
    const auto embedding = (*borders)->Embed(image_);
    if (!embedding.ok()) return {};
    return (*borders)->Refine(*embedding, mask).value_or(BinaryMask());
  }

  testing::TempFolder folder_;
  const std::filesystem::path folder_path_;
  Image image_;
  const BinaryMask square_;
};

TEST_F(SamBordersTest, MoveToWhatTheNetworkSees) {
  for (const int margin : {-6, 6}) {
    const BinaryMask mask = MaskWhere([=](int x, int y) { return InSquare(x, y, margin); });
    EXPECT_LT(Iou(mask, square_), 0.94);
    EXPECT_GT(Iou(Refined(mask), square_), 0.99) << margin;
  }
}

TEST_F(SamBordersTest, StayFarFromTheBorderOfTheMask) {
  // A second part that the network does not see, 2 % of the diagonal (12.8) and more from its rim.
  const BinaryMask mask = MaskWhere([](int x, int y) {
    return InSquare(x, y, 0) || (x >= 400 && x < 460 && y >= 100 && y < 160);
  });
  const BinaryMask refined = Refined(mask);
  EXPECT_EQ(refined.pixels[130 * kPhotoWidth + 430], 1);
  EXPECT_EQ(refined.pixels[130 * kPhotoWidth + 402], 0);
}

TEST_F(SamBordersTest, StayWhereTheNetworkSeesAnotherThing) {
  // Half of the square: the network sees all of it.
  const BinaryMask half = MaskWhere([](int x, int y) { return InSquare(x, y, 0) && x < 224; });
  EXPECT_EQ(Refined(half).pixels, half.pixels);
}

TEST_F(SamBordersTest, StayWhereThereAreNone) {
  for (const bool inside : {false, true}) {
    const BinaryMask mask = MaskWhere([=](int, int) { return inside; });
    EXPECT_EQ(Refined(mask).pixels, mask.pixels);
  }
}

TEST_F(SamBordersTest, ArePlacedByTheCpuWithoutADevice) {
  ASSERT_OK_AND_ASSIGN(const auto borders, SamBorders::Open(folder_path_, {.cuda_device = 1000}));
  EXPECT_TRUE(borders->cuda_failed());
  EXPECT_EQ(borders->processor().find("the CPU, since CUDA failed"), 0U);
  ASSERT_OK_AND_ASSIGN(const auto embedding, borders->Embed(image_));
  const BinaryMask mask = MaskWhere([](int x, int y) { return InSquare(x, y, 6); });
  ASSERT_OK_AND_ASSIGN(const BinaryMask refined, borders->Refine(embedding, mask));
  EXPECT_GT(Iou(refined, square_), 0.99);
}

TEST_F(SamBordersTest, AreRefusedWithoutGoodFiles) {
  EXPECT_TRUE(absl::IsNotFound(SamBorders::Open(folder_ / "none", {}).status()));
  testing::ReplaceSamFile(folder_path_, "sam.onnx", "another model");
  EXPECT_TRUE(absl::IsFailedPrecondition(SamBorders::Open(folder_path_, {}).status()));
  testing::ReplaceSamFile(folder_path_, "sam.onnx", testing::FakeDecoder());
  testing::ReplaceSamFile(folder_path_, "encoder.onnx", "out of memory");
  EXPECT_TRUE(absl::IsResourceExhausted(SamBorders::Open(folder_path_, {}).status()));
}

// Returns the pixels within `radius` of the mask, along each axis.
BinaryMask Grown(const BinaryMask& mask, int width, int height, int radius) {
  BinaryMask grown = mask;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      if (mask.pixels[static_cast<size_t>(y) * width + x] == 0) continue;
      for (int k = std::max(0, y - radius); k <= std::min(height - 1, y + radius); ++k) {
        const size_t row = static_cast<size_t>(k) * width;
        std::fill(grown.pixels.begin() + row + std::max(0, x - radius),
                  grown.pixels.begin() + row + std::min(width, x + radius + 1), uint8_t{1});
      }
    }
  }
  return grown;
}

// Needs the files that deploy/sam.sh installs: `make sam-test`. Masks that SAM has made of the
// photograph are grown by 4 pixels; its decoder must find their borders again.
TEST(RealSamBorders, FindTheBordersOfGrownMasks) {
  const char* folder = std::getenv("PEPESEG_SAM");
  if (folder == nullptr) GTEST_SKIP() << "PEPESEG_SAM names no folder";
  ASSERT_OK_AND_ASSIGN(const auto files, ListDataset(PEPESEG_TEST_DATA "/apc_shelf"));
  ASSERT_OK_AND_ASSIGN(auto capture, ImportCapture(files, {}));
  const View& view = capture.views[0];
  const int width = view.photo.width, height = view.photo.height;
  ASSERT_OK_AND_ASSIGN(const auto borders, SamBorders::Open(folder, {.num_threads = 2}));
  ASSERT_OK_AND_ASSIGN(const auto embedding, borders->Embed(view.photo));
  int num_masks = 0;
  double before = 0, after = 0;
  for (int k = 0; k < view.masks.num_masks; ++k) {
    if (view.masks.mask_area[k] < 4000) continue;
    const BinaryMask mask = view.masks.Extract(k), grown = Grown(mask, width, height, 4);
    ASSERT_OK_AND_ASSIGN(const BinaryMask refined, borders->Refine(embedding, grown));
    before += Iou(grown, mask);
    after += Iou(refined, mask);
    ++num_masks;
  }
  ASSERT_GE(num_masks, 10);
  EXPECT_GT(after / num_masks, before / num_masks + 0.03);
}

// Returns the seconds of processor time that this process has taken.
double CoreSeconds() {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

// Compares borders by an embedding from a file with those by ONNX Runtime, which computes it.
TEST(RealSamBorders, AreTheSameByAKeptEmbedding) {
  const char* sam = std::getenv("PEPESEG_SAM");
  if (sam == nullptr) GTEST_SKIP() << "PEPESEG_SAM names no folder";
  ASSERT_OK_AND_ASSIGN(const auto files, ListDataset(PEPESEG_TEST_DATA "/apc_shelf"));
  ASSERT_OK_AND_ASSIGN(auto capture, ImportCapture(files, {}));
  const View& view = capture.views[0];
  const int width = view.photo.width, height = view.photo.height;
  ASSERT_OK_AND_ASSIGN(const auto borders, SamBorders::Open(sam, {.num_threads = 1}));
  const testing::TempFolder folder;
  const EmbeddingOrigin origin = {borders->encoder_digest(), ""};
  const double start = CoreSeconds();
  ASSERT_OK_AND_ASSIGN(const auto computed, borders->Embed(view.photo));
  const double embedding_seconds = CoreSeconds() - start;
  const double write_start = CoreSeconds();
  ASSERT_OK(WriteEmbedding(folder / "kept", computed, origin));
  RecordProperty("write_ms", std::to_string(1e3 * (CoreSeconds() - write_start)));
  ASSERT_OK_AND_ASSIGN(const auto onnx,
                       SamModel::Open(sam, {.onnx_runtime = true, .mask_prompts = true}));
  const auto reference = onnx->MakeSegmenter();
  ASSERT_OK(reference->SetPhotograph(view.photo));
  int num_masks = 0, num_moved = 0;
  double kept_seconds = 0;
  for (int k = 0; k < view.masks.num_masks; ++k) {
    if (view.masks.mask_area[k] < 4000) continue;
    const BinaryMask grown = Grown(view.masks.Extract(k), width, height, 4);
    const double before = CoreSeconds();
    ASSERT_OK_AND_ASSIGN(const auto kept, ReadEmbedding(folder / "kept", origin));
    ASSERT_OK_AND_ASSIGN(const BinaryMask refined, borders->Refine(kept, grown));
    kept_seconds += CoreSeconds() - before;
    ASSERT_OK_AND_ASSIGN(const BinaryMask want, RefineMask(*reference, grown, width, height));
    EXPECT_GT(Iou(refined, want), 0.99) << k;
    num_moved += want.pixels != grown.pixels ? 1 : 0;
    ++num_masks;
  }
  ASSERT_GE(num_moved, 10);
  const double first_border = kept_seconds / num_masks;
  RecordProperty("ratio", std::to_string((embedding_seconds + first_border) / first_border));
  EXPECT_LT(first_border, 0.25 * (embedding_seconds + first_border));
}

}  // namespace
}  // namespace pepeseg
