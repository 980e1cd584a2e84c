#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "core/dataset/depth_files.h"
#include "core/dataset/mask_files.h"
#include "core/formats/images.h"
#include "core/formats/plain_copy.h"
#include "tests/testing/png_bytes.h"
#include "tests/testing/small_dataset.h"
#include "tests/testing/status_testing.h"

// Every way in which an image file of a dataset is read, with every kind of file: photograph, label
// image, masks, ignore mask, depth, and the copies for COLMAP and for priors commands.
namespace pepeseg {
namespace {

using ::testing::ElementsAre;
using testing::PngKind;
using testing::RawPng;
using Rgb = std::array<int, 3>;

constexpr int kSide = 2;  // of each picture: a first column and a second one

// A kind of file and what each reader makes of its two columns.
struct ImageKind {
  std::string name;
  std::string bytes;
  Rgb first, second;                              // as a photograph
  bool transparent;                               // the second column is
  std::optional<std::array<uint32_t, 2>> labels;  // absent: refused
  std::optional<std::array<float, 2>> depth;      // absent: refused
  bool plain;                                     // programs get the file as it is
};

// Returns both scanlines of a picture whose pixels are these samples.
std::string Rows(const std::string& first, const std::string& second) {
  const std::string row = std::string(1, '\0') + first + second;
  return row + row;
}

std::string Sample(int value, int bit_depth) {
  std::string bytes;
  if (bit_depth == 16) bytes += static_cast<char>(value >> 8);
  return bytes + static_cast<char>(value & 0xff);
}

std::string Pixel(const std::vector<int>& samples, int bit_depth) {
  std::string bytes;
  for (const int sample : samples) bytes += Sample(sample, bit_depth);
  return bytes;
}

ImageKind Kind(const std::string& name, const PngKind& kind, const std::vector<int>& first,
               const std::vector<int>& second) {
  ImageKind result;
  result.name = name;
  result.bytes =
      RawPng(kSide, kSide, kind, Rows(Pixel(first, kind.bit_depth), Pixel(second, kind.bit_depth)));
  result.transparent = false;
  result.plain = false;
  return result;
}

// Samples of 16 bits are 257 times those of 8, so that photographs are the same.
std::vector<ImageKind> PngKinds() {
  std::vector<ImageKind> kinds;
  for (const int bits : {8, 16}) {
    const int k = bits == 16 ? 257 : 1;
    const auto u = [k](int value) { return static_cast<uint32_t>(value * k); };
    const auto f = [k](int value) { return static_cast<float>(value * k); };
    const std::string suffix = " of " + std::to_string(bits) + " bits";
    ImageKind grey = Kind("grey" + suffix, {bits, 0}, {0}, {40 * k});
    grey.first = {0, 0, 0}, grey.second = {40, 40, 40};
    grey.labels = {0, u(40)}, grey.depth = {f(0), f(40)}, grey.plain = bits == 8;
    kinds.push_back(grey);
    ImageKind grey_alpha =
        Kind("grey and alpha" + suffix, {bits, 4}, {20 * k, 255 * k}, {40 * k, 0});
    grey_alpha.first = {20, 20, 20}, grey_alpha.second = {40, 40, 40};
    grey_alpha.transparent = true, grey_alpha.labels = {u(20), u(40)};
    kinds.push_back(grey_alpha);
    ImageKind rgb = Kind("RGB" + suffix, {bits, 2}, {0, 0, 0}, {10 * k, 20 * k, 30 * k});
    rgb.first = {0, 0, 0}, rgb.second = {10, 20, 30};
    rgb.labels = {0, 0x0a141e}, rgb.plain = bits == 8;
    kinds.push_back(rgb);
    ImageKind key = Kind("RGB with a transparent colour" + suffix,
                         {bits, 2, "", Pixel({10 * k, 20 * k, 30 * k}, 16)}, {0, 0, 0},
                         {10 * k, 20 * k, 30 * k});
    key.first = {0, 0, 0}, key.second = {10, 20, 30};
    key.transparent = true, key.labels = {0, 0x0a141e};
    kinds.push_back(key);
    ImageKind rgba =
        Kind("RGBA" + suffix, {bits, 6}, {0, 0, 0, 255 * k}, {10 * k, 20 * k, 30 * k, 0});
    rgba.first = {0, 0, 0}, rgba.second = {10, 20, 30};
    rgba.transparent = true, rgba.labels = {0, 0x0a141e};
    kinds.push_back(rgba);
  }
  for (const bool transparent : {false, true}) {
    const std::string name = transparent ? "palette with transparency" : "palette";
    ImageKind palette = Kind(
        name,
        {8, 3, std::string("\0\0\0\x0a\x14\x1e", 6), transparent ? std::string("\xff\0", 2) : ""},
        {0}, {1});
    palette.first = {0, 0, 0}, palette.second = {10, 20, 30};
    palette.transparent = transparent, palette.labels = {0, 0x0a141e};
    kinds.push_back(palette);
  }
  return kinds;
}

// Readers of files below the folder, and of their bytes.
struct ImageKindsTest : ::testing::Test {
  std::string Write(const std::string& bytes, const std::string& name) const {
    testing::WriteBytes(folder / name, bytes);
    return folder / name;
  }
  const PhotoSize photo{"photo", kSide, kSide};
  testing::TempFolder folder;
};

std::vector<uint8_t> BytesOfKind(const std::string& text) { return {text.begin(), text.end()}; }

void ExpectPhoto(const ImageKind& kind, const Image& image) {
  ASSERT_EQ(image.pixels.size(), 12u);
  EXPECT_THAT(std::vector(image.pixels.begin(), image.pixels.begin() + 6),
              ElementsAre(kind.first[0], kind.first[1], kind.first[2], kind.second[0],
                          kind.second[1], kind.second[2]));
}

TEST_F(ImageKindsTest, ArePhotographs) {
  for (const ImageKind& kind : PngKinds()) {
    SCOPED_TRACE(kind.name);
    std::vector<uint8_t> transparent;
    ASSERT_OK_AND_ASSIGN(const Image image,
                         DecodePhoto(Write(kind.bytes, "a.png"), "a.png", &transparent));
    ExpectPhoto(kind, image);
    EXPECT_EQ(transparent, kind.transparent ? (std::vector<uint8_t>{0, 1, 0, 1})
                                            : std::vector<uint8_t>(transparent.size(), 0));
  }
}

TEST_F(ImageKindsTest, AreLabelsMasksAndIgnoreMasks) {
  for (const ImageKind& kind : PngKinds()) {
    SCOPED_TRACE(kind.name);
    const std::string path = Write(kind.bytes, "a.png");
    ASSERT_OK_AND_ASSIGN(const LabelImage labels, DecodeLabels(path, "a.png"));
    const auto [first, second] = *kind.labels;
    EXPECT_THAT(labels.labels, ElementsAre(first, second, first, second));
    ASSERT_OK_AND_ASSIGN(const MaskSet masks, ReadMasks(path, "a.png", photo));
    EXPECT_EQ(masks.num_masks, first == 0 ? 1 : 2);
    EXPECT_TRUE(masks.Covers(masks.num_masks - 1, 1, 0));
    ASSERT_OK_AND_ASSIGN(const auto ignore, ReadIgnoreMask(path, "a.png", photo));
    const int is_first = first != 0;
    EXPECT_THAT(ignore, ElementsAre(is_first, 1, is_first, 1));
  }
}

// White where it is opaque and where it is not, as programs that cut things out write it.
TEST_F(ImageKindsTest, AreMasksByAlphaIfTheyAreCutOuts) {
  for (const int bits : {8, 16}) {
    const int most = bits == 16 ? 0xffff : 0xff;
    for (const bool grey : {false, true}) {
      const std::vector<int> colour(grey ? 1 : 3, most);
      std::vector<int> opaque = colour, transparent = colour;
      opaque.push_back(most);
      transparent.push_back(0);
      const ImageKind kind = Kind("cut-out", {bits, grey ? 4 : 6}, opaque, transparent);
      SCOPED_TRACE(bits + 100 * grey);
      ASSERT_OK_AND_ASSIGN(const LabelImage labels,
                           DecodeLabels(Write(kind.bytes, "a.png"), "a.png"));
      EXPECT_THAT(labels.labels, ElementsAre(1, 0, 1, 0));
    }
  }
}

TEST_F(ImageKindsTest, HaveTheColourOfTheLastPaletteEntryAsVoidLabel) {
  const auto void_label = [&](const std::string& palette) {
    const ImageKind kind = Kind("palette", {8, 3, palette, ""}, {0}, {255});
    const auto labels = DecodeLabels(Write(kind.bytes, "a.png"), "a.png");
    EXPECT_OK(labels);
    return labels.ok() ? labels->void_label : 0;
  };
  std::string palette(3 * 256, '\0');
  for (size_t i = 0; i < 256; ++i) palette[3 * i] = static_cast<char>(i);
  palette.replace(3 * 255, 3, "\xe0\xe0\xc0");
  EXPECT_EQ(void_label(palette), 0xe0e0c0u);
  std::string bright = palette;
  bright[1] = 1;
  EXPECT_EQ(void_label(bright), 255u) << "entry 0 is no background";
  palette.replace(3 * 254, 3, "\xe0\xe0\xc0");
  EXPECT_EQ(void_label(palette), 255u) << "two entries have the colour";
}

TEST_F(ImageKindsTest, AreDepthIfTheyHaveOneChannel) {
  for (const ImageKind& kind : PngKinds()) {
    SCOPED_TRACE(kind.name);
    const auto map =
        ReadDepthMap(Write(kind.bytes, "a.png"), "a.png", DepthPrior::Kind::kDisparity, photo);
    if (!kind.depth) {
      EXPECT_STATUS(map, absl::StatusCode::kInvalidArgument,
                    "a.png: has colours, a palette or alpha");
      continue;
    }
    ASSERT_OK(map);
    EXPECT_THAT(map->values, ElementsAre((*kind.depth)[0], (*kind.depth)[1], (*kind.depth)[0],
                                         (*kind.depth)[1]));
  }
}

TEST_F(ImageKindsTest, AreCopiedPlainlyForPrograms) {
  for (const ImageKind& kind : PngKinds()) {
    for (const PlainCopyOptions& options :
         {PlainCopyOptions{.upright = false, .webp = true}, PlainCopyOptions{}}) {
      SCOPED_TRACE(kind.name);
      ASSERT_OK_AND_ASSIGN(std::string copy, PlainCopy(BytesOfKind(kind.bytes), "a", options));
      EXPECT_EQ(copy.empty(), kind.plain);
      if (kind.plain) continue;
      EXPECT_EQ(copy[24], 8) << "bits a sample";
      EXPECT_EQ(copy[25], 2) << "RGB";
      ASSERT_OK_AND_ASSIGN(const Image image, DecodePhoto(BytesOfKind(copy), "a"));
      ExpectPhoto(kind, image);
    }
  }
}

TEST_F(ImageKindsTest, OfJpegAndWebpArePhotographsOnly) {
  const std::string jpeg = testing::Jpeg(testing::Picture(kSide, kSide));
  const std::string webp = testing::ReadBytes(PEPESEG_TEST_DATA "/images/lossless.webp");
  const PhotoSize webp_size{"photo", 32, 24};
  for (const auto& [bytes, size] : {std::pair(jpeg, photo), std::pair(webp, webp_size)}) {
    const std::string path = Write(bytes, "a.png");
    ASSERT_OK(DecodePhoto(path, "a.png"));
    for (const absl::Status& status :
         {DecodeLabels(path, "a.png").status(), ReadMasks(path, "a.png", size).status(),
          ReadIgnoreMask(path, "a.png", size).status(),
          ReadDepthMap(path, "a.png", DepthPrior::Kind::kDepth, size).status()}) {
      EXPECT_STATUS(status, absl::StatusCode::kInvalidArgument, "PNG");
    }
  }
  ASSERT_OK_AND_ASSIGN(const std::string for_colmap,
                       PlainCopy(BytesOfKind(webp), "a", {.upright = false, .webp = true}));
  EXPECT_TRUE(for_colmap.empty());
  ASSERT_OK_AND_ASSIGN(const std::string for_priors, PlainCopy(BytesOfKind(webp), "a"));
  EXPECT_EQ(for_priors.substr(1, 3), "PNG");
}

}  // namespace
}  // namespace pepeseg
