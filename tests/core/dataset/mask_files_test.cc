#include "core/dataset/mask_files.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "core/formats/rle.h"
#include "tests/testing/small_dataset.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using absl::StatusCode::kInvalidArgument;
using testing::TempFolder;
using testing::WriteBytes;

const PhotoSize kPhoto = {"images/a.jpg", 4, 3};

absl::StatusOr<MaskSet> ReadJson(const std::string& text) {
  const TempFolder folder;
  WriteBytes(folder / "a.json", text);
  return ReadMasks(folder / "a.json", "masks/a.json", kPhoto);
}

TEST(SamMasks, AreReadPlainAndCompressed) {
  const BinaryMask mask = {{0, 1, 1, 0, 0, 1, 0, 0, 0, 0, 0, 1}};
  const std::string compressed = EncodeCocoRle(mask, 4, 3);
  for (const std::string& counts : {std::string("[3, 2, 1, 1, 4, 1]"), '"' + compressed + '"'}) {
    ASSERT_OK_AND_ASSIGN(
        const MaskSet set,
        ReadJson(R"([{"bbox": [1, 2], "segmentation": {"size": [3, 4], "counts": )" + counts +
                 R"(}, "stability_score": 0.9}])"));
    ASSERT_EQ(set.num_masks, 1);
    EXPECT_EQ(set.Extract(0).pixels, mask.pixels);
  }
}

TEST(SamMasks, MayBeAnEmptyList) {
  ASSERT_OK_AND_ASSIGN(const MaskSet set, ReadJson("[]"));
  EXPECT_TRUE(set.empty());
}

TEST(SamMasks, AreRejectedNamingBothSizesIfTheyDiffer) {
  EXPECT_STATUS(ReadJson(R"([{"segmentation": {"size": [4, 3], "counts": [12]}}])"),
                kInvalidArgument,
                "masks/a.json: mask 0: has 3x4 pixels, its photograph images/a.jpg has 4x3");
}

TEST(SamMasks, AreRejectedNamingTheMalformedMask) {
  const std::string good = R"({"segmentation": {"size": [3, 4], "counts": [0, 12]}}, )";
  const auto bad = [&](const std::string& text) { return ReadJson("[" + good + text + "]"); };
  EXPECT_STATUS(bad("3"), kInvalidArgument, "masks/a.json: mask 1");
  EXPECT_STATUS(bad("{}"), kInvalidArgument, "mask 1: has no \"segmentation\"");
  EXPECT_STATUS(bad(R"({"segmentation": [[1, 2, 3]]})"), kInvalidArgument, "mask 1");
  EXPECT_STATUS(bad(R"({"segmentation": {"size": [3, 4]}})"), kInvalidArgument, "counts");
  EXPECT_STATUS(bad(R"({"segmentation": {"size": [3, 4.5], "counts": [12]}})"), kInvalidArgument,
                "size");
  EXPECT_STATUS(bad(R"({"segmentation": {"size": [3, 4], "counts": [0, 13]}})"), kInvalidArgument,
                "mask 1: run 1");
  EXPECT_STATUS(bad(R"({"segmentation": {"size": [3, 4], "counts": [0, "x"]}})"), kInvalidArgument,
                "run 1");
  EXPECT_STATUS(bad(R"({"segmentation": {"size": [3, 4], "counts": [18446744073709551615]}})"),
                kInvalidArgument, "run 0");
  EXPECT_STATUS(ReadJson("{}"), kInvalidArgument, "masks/a.json: is not a list");
  EXPECT_STATUS(ReadJson("[{"), kInvalidArgument, "masks/a.json: is not JSON");
  EXPECT_STATUS(ReadJson(std::string(64, '[')), kInvalidArgument, "is not JSON");
  EXPECT_STATUS(ReadJson(std::string(65, '[')), kInvalidArgument,
                "masks/a.json: is nested deeper than 64 levels");
  EXPECT_STATUS(ReadJson(std::string(100'000, '[')), kInvalidArgument, "nested deeper");
}

TEST(SamMasks, HaveALimitedNumber) {
  std::string text = "[0";
  for (int i = 0; i < kMaxMasksOfView; ++i) text += ",0";
  EXPECT_STATUS(ReadJson(text + "]"), kInvalidArgument, "has 4097 masks, the limit is 4096");
}

TEST(LabelMasks, AreOnePerNonZeroValue) {
  const TempFolder folder;
  WriteBytes(folder / "a.png", testing::Png({4, 3, 1, {0, 7, 7, 0, 0, 7, 9, 9, 0, 0, 0, 9}}));
  ASSERT_OK_AND_ASSIGN(const MaskSet set, ReadMasks(folder / "a.png", "masks/a.png", kPhoto));
  EXPECT_EQ(set.mask_area, (std::vector<int64_t>{3, 3}));
  EXPECT_TRUE(set.Covers(0, 1, 1));
  EXPECT_TRUE(set.Covers(1, 3, 2));
  EXPECT_STATUS(ReadMasks(folder / "a.png", "masks/a.png", {"b.jpg", 3, 4}), kInvalidArgument,
                "masks/a.png: has 4x3 pixels, its photograph b.jpg has 3x4");
}

TEST(IgnoreMask, IsOneWhereThePixelIsNotZero) {
  const TempFolder folder;
  WriteBytes(folder / "a.png", testing::Png({4, 3, 1, {0, 7, 0, 0, 0, 255, 0, 0, 0, 0, 0, 1}}));
  ASSERT_OK_AND_ASSIGN(const auto mask, ReadIgnoreMask(folder / "a.png", "ignore/a.png", kPhoto));
  EXPECT_EQ(mask, (std::vector<uint8_t>{0, 1, 0, 0, 0, 1, 0, 0, 0, 0, 0, 1}));
  EXPECT_STATUS(ReadIgnoreMask(folder / "a.png", "ignore/a.png", {"b.jpg", 9, 9}), kInvalidArgument,
                "ignore/a.png: has 4x3 pixels, its photograph b.jpg has 9x9");
}

// Masks made on photographs of half of the size, in each form.
TEST(Masks, OfAnotherSizeAreScaledToTheirPhotograph) {
  const PhotoSize photo = {"images/a.jpg", 8, 6};
  const std::vector<uint8_t> left = {1, 1, 0, 0, 1, 1, 0, 0, 1, 1, 0, 0};
  const TempFolder folder;
  WriteBytes(folder / "a.json", R"([{"segmentation": {"size": [3, 4], "counts": [0, 6, 6]}}])");
  WriteBytes(folder / "a.png", testing::Png({4, 3, 1, left}));
  for (const char* name : {"a.json", "a.png"}) {
    ASSERT_OK_AND_ASSIGN(const MaskSet set, ReadMasks(folder / name, name, photo));
    ASSERT_EQ(set.num_masks, 1) << name;
    const std::vector<uint8_t> pixels = set.Extract(0).pixels;
    ASSERT_EQ(pixels.size(), 48u) << name;
    for (size_t i = 0; i < pixels.size(); ++i) EXPECT_EQ(pixels[i], i % 8 < 4) << name << " " << i;
  }
  ASSERT_OK_AND_ASSIGN(const auto ignore, ReadIgnoreMask(folder / "a.png", "a.png", photo));
  EXPECT_EQ(std::count(ignore.begin(), ignore.end(), 1), 24);
}

// A blurred mask of one thing is not a mask for each grey value.
// A thing of label 7 left of one of label 9, and `border` pixels of 255 between them.
Image BorderedLabels(int border) {
  Image image{32, 8, 1, {}};
  for (int i = 0; i < 32 * 8; ++i) {
    const int x = i % 32;
    image.pixels.push_back(static_cast<uint8_t>(x < 10 ? 7 : x < 10 + border ? 255 : 9));
  }
  return image;
}

TEST(LabelMasks, LeaveOutVoidBorders) {
  const TempFolder folder;
  for (const int border : {1, 5, 12}) {
    WriteBytes(folder / "a.png", testing::Png(BorderedLabels(border)));
    LabelNotes notes;
    ASSERT_OK_AND_ASSIGN(const MaskSet set,
                         ReadMasks(folder / "a.png", "a.png", {"a.jpg", 32, 8}, &notes));
    const bool is_void = border < 12;  // a thing is wider than a border
    EXPECT_EQ(notes.has_void, is_void) << border;
    EXPECT_EQ(set.num_masks, is_void ? 2 : 3) << border;
    EXPECT_EQ(set.Covers(set.num_masks - 1, 10, 4), !is_void) << border;
    // Read as an ignore mask, the file has no void pixels.
    ASSERT_OK_AND_ASSIGN(const auto ignore,
                         ReadIgnoreMask(folder / "a.png", "a.png", {"a.jpg", 32, 8}));
    EXPECT_EQ(ignore[10], 1);
  }
}

// A thin thing of 255, far from the other.
TEST(LabelMasks, KeepThinThingsThatAreNoBorders) {
  Image image{32, 8, 1, {}};
  for (int i = 0; i < 32 * 8; ++i) {
    const int x = i % 32;
    image.pixels.push_back(static_cast<uint8_t>(x < 10 ? 7 : x == 20 ? 255 : 0));
  }
  const TempFolder folder;
  WriteBytes(folder / "a.png", testing::Png(image));
  ASSERT_OK_AND_ASSIGN(const MaskSet set, ReadMasks(folder / "a.png", "a.png", {"a.jpg", 32, 8}));
  EXPECT_EQ(set.num_masks, 2);
}

// 254 masks and one more: the last one, though small, is not void.
TEST(LabelMasks, KeepTheLastOfASeries) {
  Image image{64, 64, 1, {}};
  for (int i = 0; i < 64 * 64; ++i) {
    image.pixels.push_back(static_cast<uint8_t>(i / 64 / 4 * 16 + i % 64 / 4));
  }
  const TempFolder folder;
  WriteBytes(folder / "a.png", testing::Png(image));
  ASSERT_OK_AND_ASSIGN(const MaskSet set, ReadMasks(folder / "a.png", "a.png", {"a.jpg", 64, 64}));
  EXPECT_EQ(set.num_masks, 255);
}

TEST(Masks, WithSoftBordersAreOne) {
  Image image{32, 8, 1, {}};
  for (int i = 0; i < 32 * 8; ++i) {
    image.pixels.push_back(static_cast<uint8_t>(std::clamp((i % 32 - 12) * 36, 0, 255)));
  }
  const TempFolder folder;
  WriteBytes(folder / "a.png", testing::Png(image));
  LabelNotes notes;
  ASSERT_OK_AND_ASSIGN(const MaskSet set,
                       ReadMasks(folder / "a.png", "a.png", {"a.jpg", 32, 8}, &notes));
  EXPECT_TRUE(notes.soft);
  EXPECT_FALSE(notes.has_void);
  ASSERT_EQ(set.num_masks, 1);
  const std::vector<uint8_t> pixels = set.Extract(0).pixels;
  EXPECT_EQ(std::count(pixels.begin(), pixels.end(), 1), 8 * 16);
  const DatasetFile file = {FileKind::kMask, "masks/a/0.png", folder / "a.png"};
  const DatasetFile* files[] = {&file};
  ASSERT_OK_AND_ASSIGN(const MaskSet binary, ReadBinaryMasks(files, {"a.jpg", 32, 8}));
  EXPECT_EQ(binary.Extract(0).pixels, pixels);
}

}  // namespace
}  // namespace pepeseg
