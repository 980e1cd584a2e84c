// Masks as folders of binary PNGs and as arrays.
#include <gtest/gtest.h>

#include <string>

#include "core/dataset/import.h"
#include "core/dataset/mask_files.h"
#include "tests/testing/small_dataset.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using absl::StatusCode::kInvalidArgument;
using testing::SmallDataset;
using testing::WriteBytes;

// Returns an NPY file of version 1.
std::string Npy(const std::string& type, const std::string& shape, const std::string& values,
                const std::string& order = "False") {
  const std::string header =
      "{'descr': '" + type + "', 'fortran_order': " + order + ", 'shape': " + shape + ", }\n";
  std::string bytes("\x93NUMPY\x01\0", 8);
  bytes += static_cast<char>(header.size());
  bytes += '\0';
  return bytes + header + values;
}

// Returns a PNG of 40x30 pixels whose columns `from` to `to` - 1 are 255.
std::string Columns(int from, int to) {
  Image image{40, 30, 1, std::vector<uint8_t>(1200, 0)};
  for (int i = 0; i < 1200; ++i) image.pixels[i] = i % 40 >= from && i % 40 < to ? 255 : 0;
  return testing::Png(image);
}

absl::StatusOr<MaskSet> ReadNpy(const std::string& bytes) {
  const testing::TempFolder folder;
  WriteBytes(folder / "a.npy", bytes);
  return ReadMasks(folder / "a.npy", "masks/a.npy", {"images/a.jpg", 4, 3});
}

TEST(MaskFolders, HaveOneMaskAFileAndMayOverlap) {
  SmallDataset dataset;
  WriteBytes(dataset.folder / "masks/b/0.png", Columns(0, 4));
  WriteBytes(dataset.folder / "masks/b/1.png", Columns(2, 10));
  WriteBytes(dataset.folder / "masks/sub/c/cup.png", Columns(5, 6));
  dataset.Write();
  ASSERT_OK_AND_ASSIGN(const Capture capture, dataset.Import());
  EXPECT_EQ(capture.views[1].masks.mask_area, (std::vector<int64_t>{120, 240}));
  EXPECT_TRUE(capture.views[1].masks.Covers(0, 3, 0));
  EXPECT_TRUE(capture.views[1].masks.Covers(1, 3, 0));
  EXPECT_EQ(capture.views[2].masks.mask_area, std::vector<int64_t>{30});
  EXPECT_TRUE(capture.warnings.empty());
}

// "sub/c.png" is a photograph, so masks/sub/c.png is not a mask of a photograph "sub".
TEST(MaskFolders, DoNotTakeLabelImagesOfPhotographsInFolders) {
  SmallDataset dataset;
  WriteBytes(dataset.folder / "masks/sub/c.png", Columns(0, 4));
  dataset.Write();
  ASSERT_OK_AND_ASSIGN(const Capture capture, dataset.Import());
  EXPECT_EQ(capture.views[2].masks.mask_area, std::vector<int64_t>{120});
}

TEST(MaskFolders, AreReadByImportPriors) {
  SmallDataset dataset;
  WriteBytes(dataset.folder / "masks/b/0.png", Columns(0, 4));
  dataset.Write();
  ASSERT_OK_AND_ASSIGN(std::vector<DatasetFile> files, ListDataset(dataset.folder.path()));
  const auto is_mask = [](const DatasetFile& file) { return file.kind == FileKind::kMask; };
  std::vector<DatasetFile> masks;
  std::copy_if(files.begin(), files.end(), std::back_inserter(masks), is_mask);
  std::erase_if(files, is_mask);
  ASSERT_OK_AND_ASSIGN(Capture capture, ImportCapture(files, {}));
  ASSERT_OK(ImportPriors(masks, capture));
  EXPECT_EQ(capture.views[1].masks.mask_area, std::vector<int64_t>{120});
}

TEST(MaskFolders, AreRefusedNextToAnotherForm) {
  SmallDataset dataset;
  WriteBytes(dataset.folder / "masks/a/0.png", Columns(0, 4));
  dataset.Write();
  EXPECT_STATUS(dataset.Import(), kInvalidArgument,
                "two forms of masks for a: masks/a.json and masks/a/0.png");
}

TEST(MaskFolders, RefuseAMaskOfAnotherShape) {
  SmallDataset dataset;
  WriteBytes(dataset.folder / "masks/b/0.png",
             testing::Png({15, 20, 1, std::vector<uint8_t>(300, 1)}));
  dataset.Write();
  EXPECT_STATUS(dataset.Import(), kInvalidArgument,
                "masks/b/0.png: has 15x20 pixels, its photograph images/b.jpg has 40x30");
}

TEST(MaskArrays, AreReadAsBooleansAndBytes) {
  const std::string values(
      "\1\1\0\0\0\0\0\0\0\0\0\0"
      "\0\1\0\0\0\5\0\0\0\7\0\0",
      24);
  for (const char* type : {"|b1", "|u1"}) {
    ASSERT_OK_AND_ASSIGN(const MaskSet masks, ReadNpy(Npy(type, "(2, 3, 4)", values)));
    EXPECT_EQ(masks.mask_area, (std::vector<int64_t>{2, 3}));
    EXPECT_TRUE(masks.Covers(0, 1, 0) && masks.Covers(1, 1, 0) && masks.Covers(1, 1, 2));
  }
  ASSERT_OK_AND_ASSIGN(const MaskSet none, ReadNpy(Npy("|b1", "(0, 3, 4)", "")));
  EXPECT_TRUE(none.empty());
}

TEST(MaskArrays, RefuseOtherTypesShapesAndSizes) {
  const std::string values(12, '\1');
  EXPECT_STATUS(ReadNpy(Npy("<f4", "(1, 3, 4)", values)), kInvalidArgument, "|b1 or |u1");
  EXPECT_STATUS(ReadNpy(Npy("|b1", "(3, 4)", values)), kInvalidArgument, "(masks, height, width)");
  EXPECT_STATUS(ReadNpy(Npy("|b1", "(1, 4, 3)", values)), kInvalidArgument, "has 3x4 pixels");
  EXPECT_STATUS(ReadNpy(Npy("|b1", "(2, 3, 4)", values)), kInvalidArgument, "cut short");
  EXPECT_STATUS(ReadNpy(Npy("|b1", "(1, 3, 4)", values, "True")), kInvalidArgument, "C order");
  EXPECT_STATUS(ReadNpy(Npy("|b1", "(99999999999999999, 3, 4)", values)), kInvalidArgument,
                "cut short");
}

}  // namespace
}  // namespace pepeseg
