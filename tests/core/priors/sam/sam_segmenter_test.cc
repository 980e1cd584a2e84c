#include "core/priors/sam/sam_segmenter.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <thread>

#include "core/dataset/import.h"
#include "core/onnx/onnx_runtime.h"
#include "core/priors/sam/automatic_masks.h"
#include "core/priors/sam/sam_networks.h"
#include "tests/testing/fake_sam.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::MakeFakeSam;
using testing::ReplaceSamFile;

std::string Text(const absl::Status& status) { return std::string(status.message()); }

struct SamFilesTest : ::testing::Test {
  SamFilesTest() : sam(folder / "sam") { MakeFakeSam(sam); }
  absl::Status Open() { return SamModel::Open(sam, {}).status(); }

  testing::TempFolder folder;
  const std::filesystem::path sam;
};

TEST_F(SamFilesTest, MustMatchTheirDigests) {
  EXPECT_OK(CheckSamFiles(sam));
  std::ofstream(sam / "encoder.onnx", std::ios::app) << "x";
  const absl::Status status = CheckSamFiles(sam);
  EXPECT_TRUE(absl::IsFailedPrecondition(status)) << status;
  EXPECT_THAT(Text(status), AllOf(HasSubstr("encoder.onnx: its SHA-256 is "),
                                  HasSubstr("deploy/sam.sh " + sam.string())));
  EXPECT_EQ(Open(), status);
}

TEST_F(SamFilesTest, AreNamedWhenTheyAreMissing) {
  std::filesystem::remove(sam / "sam.onnx");
  EXPECT_THAT(Text(CheckSamFiles(sam)), HasSubstr("sam.onnx"));
  std::ofstream(sam / "SHA256SUMS") << "00  encoder.onnx\n";
  EXPECT_TRUE(absl::IsFailedPrecondition(CheckSamFiles(sam)));
  std::filesystem::remove(sam / "SHA256SUMS");
  EXPECT_TRUE(absl::IsNotFound(CheckSamFiles(sam)));
  EXPECT_THAT(Text(CheckSamFiles(folder / "none")), HasSubstr("deploy/sam.sh"));
}

TEST_F(SamFilesTest, AreRefusedWhereTheLibraryDoesNotLoad) {
  ReplaceSamFile(sam, "libonnxruntime.so.1", "a text");
  EXPECT_TRUE(absl::IsFailedPrecondition(Open()));
  EXPECT_THAT(Text(Open()), HasSubstr("libonnxruntime.so.1: does not load: "));
}

TEST_F(SamFilesTest, AreRefusedWhereTheLibraryIsAnother) {
  EXPECT_THAT(Text(OnnxRuntime::Load("libm.so.6").status()), HasSubstr("is not ONNX Runtime"));
}

TEST_F(SamFilesTest, AreRefusedWhereTheModelIsTruncated) {
  const std::string decoder = testing::FakeDecoder();
  ReplaceSamFile(sam, "sam.onnx", decoder.substr(0, decoder.size() / 2));
  EXPECT_TRUE(absl::IsFailedPrecondition(Open()));
  EXPECT_THAT(Text(Open()), HasSubstr("sam.onnx: not an ONNX model, or cut off"));
}

TEST_F(SamFilesTest, AreRefusedWhereTheModelIsAnother) {
  ReplaceSamFile(sam, "sam.onnx", testing::ProtoBytes(7, testing::ProtoBytes(2, "a graph")));
  EXPECT_THAT(Text(Open()), HasSubstr("sam.onnx: not the expected model: it has no tensor /"));
}

TEST_F(SamFilesTest, ReportThatMemoryRanOut) {
  ReplaceSamFile(sam, "encoder.onnx", "out of memory");
  EXPECT_TRUE(absl::IsResourceExhausted(Open())) << Open();
}

double BestIou(const MaskSet& masks, const BinaryMask& thing) {
  double best = 0;
  for (int k = 0; k < masks.num_masks; ++k) {
    const BinaryMask mask = masks.Extract(k);
    double common = 0, united = 0;
    for (size_t i = 0; i < mask.pixels.size(); ++i) {
      common += mask.pixels[i] & thing.pixels[i];
      united += mask.pixels[i] | thing.pixels[i];
    }
    best = std::max(best, common / united);
  }
  return best;
}

// A photograph with a red left half, a blue right half and a green square. The fake network
// segments by colour, in cells of 16 pixels of its frame, which is as large as this photograph.
TEST_F(SamFilesTest, SegmentThroughTheLibrarysInterface) {
  View view;
  constexpr int kWidth = 1024, kHeight = 640;
  view.photo = {kWidth, kHeight, 3, {}};
  BinaryMask reds, greens, blues;
  for (int i = 0; i < kWidth * kHeight; ++i) {
    const int x = i % kWidth, y = i / kWidth;
    const bool green = x >= 640 && x < 896 && y >= 160 && y < 416, red = x < 512,
               blue = !red && !green;
    reds.pixels.push_back(red ? 1 : 0);
    greens.pixels.push_back(green ? 1 : 0);
    blues.pixels.push_back(blue ? 1 : 0);
    for (const bool lit : {red, green, blue}) view.photo.pixels.push_back(lit ? 250 : 0);
  }
  ASSERT_OK_AND_ASSIGN(const auto model, SamModel::Open(sam, {}));
  const auto segmenter = model->MakeSegmenter();
  ASSERT_OK_AND_ASSIGN(const auto made, SegmentPhotograph(*segmenter, view, {}, {},
                                                          [] { return absl::OkStatus(); }));
  EXPECT_EQ(made.num_prompts, 144);
  EXPECT_EQ(made.masks.num_masks, 3);
  for (const BinaryMask& thing : {reds, greens, blues}) {
    EXPECT_GT(BestIou(made.masks, thing), 0.97);
  }
}

Image Stripes(int stripe) {
  Image photo{256, 192, 3, {}};
  for (int i = 0; i < photo.width * photo.height; ++i) {
    photo.pixels.insert(photo.pixels.end(), 3, i % photo.width / stripe % 2 == 0 ? 20 : 220);
  }
  return photo;
}

TEST_F(SamFilesTest, SegmentSeveralPhotographsAtTheSameTime) {
  const auto model = SamModel::Open(sam, {.num_threads = 2});
  ASSERT_OK(model);
  const auto segment = [&model](int stripe) {
    View view;
    view.photo = Stripes(stripe);
    const auto segmenter = (*model)->MakeSegmenter();
    auto made = SegmentPhotograph(*segmenter, view, {}, {}, [] { return absl::OkStatus(); });
    return made.ok() ? made->masks : MaskSet();
  };
  const MaskSet alone[] = {segment(64), segment(128)};
  MaskSet together[2];
  {
    const std::jthread other([&] { together[0] = segment(64); });
    together[1] = segment(128);
  }
  for (int i = 0; i < 2; ++i) {
    EXPECT_GT(alone[i].num_masks, 0);
    EXPECT_EQ(alone[i].mask_area, together[i].mask_area);
    EXPECT_EQ(alone[i].pixel_cell, together[i].pixel_cell);
  }
  EXPECT_NE(alone[0].pixel_cell, alone[1].pixel_cell);
}

// CUDA fails on every machine: it has no GPU, or the test's files are not the networks.
TEST_F(SamFilesTest, AreRunOnTheCpuWhereCudaFails) {
  int num_opened = 0;
  SamOptions options;
  options.before_cpu = [&] { ++num_opened; };
  ASSERT_OK_AND_ASSIGN(const auto on_cpu, SamModel::Open(sam, options));
  EXPECT_EQ(on_cpu->processor(), "the CPU");
  EXPECT_FALSE(on_cpu->cuda_failed());
  options.cuda_device = 0;
  ASSERT_OK_AND_ASSIGN(const auto model, SamModel::Open(sam, options));
  EXPECT_THAT(model->processor(), HasSubstr("the CPU, since CUDA failed: "));
  EXPECT_TRUE(model->cuda_failed());
  EXPECT_FALSE(model->on_device());
  EXPECT_EQ(num_opened, 2);
  EXPECT_OK(model->MakeSegmenter()->SetPhotograph(Stripes(64)));
}

TEST_F(SamFilesTest, EndCallsOnInterrupt) {
  ReplaceSamFile(sam, "encoder.onnx", "endless");
  ASSERT_OK_AND_ASSIGN(const auto model, SamModel::Open(sam, {}));
  const auto segmenter = model->MakeSegmenter();
  absl::Status status;
  {
    const std::jthread call([&] { status = segmenter->SetPhotograph(Stripes(64)); });
    model->Interrupt();
  }
  EXPECT_TRUE(absl::IsCancelled(status)) << status;
  EXPECT_TRUE(absl::IsCancelled(segmenter->SetPhotograph(Stripes(64))));
}

// Needs the files that deploy/sam.sh installs: `make sam-test`.
TEST(RealSam, FindsTheProductsOfTheShelf) {
  const char* folder = std::getenv("PEPESEG_SAM");
  if (folder == nullptr) GTEST_SKIP() << "PEPESEG_SAM names no folder";
  ASSERT_OK_AND_ASSIGN(const auto files, ListDataset(PEPESEG_TEST_DATA "/apc_shelf"));
  ASSERT_OK_AND_ASSIGN(auto capture, ImportCapture(files, {}));
  const View& view = capture.views[0];
  ASSERT_OK_AND_ASSIGN(const auto model, SamModel::Open(folder, {.num_threads = 2}));
  const auto segmenter = model->MakeSegmenter();
  AutomaticMaskOptions options;
  options.points_per_side = 8;
  const auto made =
      SegmentPhotograph(*segmenter, view, {}, options, [] { return absl::OkStatus(); });
  ASSERT_OK(made);
  EXPECT_GE(made->masks.num_masks, 15);
  // The masks that come with the scene were made by the same network in another program.
  int num_found = 0, num_large = 0;
  for (int k = 0; k < view.masks.num_masks; ++k) {
    if (view.masks.mask_area[k] < 4000) continue;
    ++num_large;
    num_found += BestIou(made->masks, view.masks.Extract(k)) > 0.85 ? 1 : 0;
  }
  EXPECT_GE(num_large, 10);
  EXPECT_GE(num_found, num_large / 2) << num_found << " of " << num_large;
}

}  // namespace
}  // namespace pepeseg
