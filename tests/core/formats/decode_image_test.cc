#include <gtest/gtest.h>
#include <zlib.h>

#include <array>
#include <cmath>
#include <ctime>
#include <string>
#include <utility>
#include <vector>

#include "core/formats/image_header.h"
#include "core/formats/images.h"
#include "tests/testing/png_bytes.h"
#include "tests/testing/small_dataset.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using absl::StatusCode::kInvalidArgument;
using testing::Jpeg;
using testing::Picture;
using testing::Png;
using testing::TempFolder;
using testing::WriteBytes;

absl::StatusOr<Image> Decode(const std::string& bytes, const std::string& name) {
  const TempFolder folder;
  WriteBytes(folder / "image", bytes);
  return DecodePhoto(folder / "image", name);
}

TEST(DecodePhoto, ReadsPngExactlyAndJpegClosely) {
  const Image picture = Picture(60, 35);
  ASSERT_OK_AND_ASSIGN(const Image png, Decode(Png(picture), "a.png"));
  EXPECT_EQ(png.width, 60);
  EXPECT_EQ(png.height, 35);
  EXPECT_EQ(png.pixels, picture.pixels);
  ASSERT_OK_AND_ASSIGN(const Image jpeg, Decode(Jpeg(picture), "a.jpg"));
  ASSERT_EQ(jpeg.pixels.size(), picture.pixels.size());
  double error = 0;
  for (size_t i = 0; i < jpeg.pixels.size(); ++i) {
    error += std::abs(jpeg.pixels[i] - picture.pixels[i]);
  }
  EXPECT_LT(error / static_cast<double>(jpeg.pixels.size()), 4);
}

// Both show red 7 ((x + y) % 16), green 5 x, blue 3 y.
TEST(DecodePhoto, ReadsWebp) {
  for (const std::string name : {"lossless.webp", "lossy.webp"}) {
    const std::string path = std::string(PEPESEG_TEST_DATA "/images/") + name;
    ASSERT_OK_AND_ASSIGN(const Image image, DecodePhoto(path, name));
    ASSERT_EQ(image.width, 32);
    ASSERT_EQ(image.height, 24);
    const int most = name == "lossless.webp" ? 0 : 40;
    for (const int x : {4, 20, 31}) {
      const int y = 10;
      EXPECT_NEAR(image.pixels[3 * (32 * y + x)], 7 * ((x + y) % 16), most) << name;
      EXPECT_NEAR(image.pixels[3 * (32 * y + x) + 1], 5 * x, most) << name;
      EXPECT_NEAR(image.pixels[3 * (32 * y + x) + 2], 3 * y, most) << name;
    }
    const std::string bytes = testing::ReadBytes(path);
    for (int twentieth = 0; twentieth < 20; ++twentieth) {
      EXPECT_STATUS(Decode(bytes.substr(0, bytes.size() * twentieth / 20), "cut.webp"),
                    kInvalidArgument, "cut.webp: ");
    }
  }
}

// Returns a PNG of 2x1 pixels, the first opaque red, the second transparent. `colour_type` is
// PNG's: 2 colour with tRNS, 3 palette with tRNS, 6 colour with alpha.
std::string RedAndTransparent(int colour_type, int bit_depth) {
  std::string row(1, '\0');
  const auto add = [&](std::initializer_list<int> channels) {
    for (const int value : channels) {
      row.append(static_cast<size_t>(bit_depth / 8), static_cast<char>(value));
    }
  };
  std::string header(8, '\0'), packed(100, '\0'), png = "\x89PNG\r\n\x1a\n";
  header[3] = 2, header[7] = 1;
  header += {static_cast<char>(bit_depth), static_cast<char>(colour_type), 0, 0, 0};
  testing::AppendPngChunk("IHDR", header, &png);
  if (colour_type == 3) {
    testing::AppendPngChunk("PLTE", std::string("\xff\0\0\0\xff\0", 6), &png);
    testing::AppendPngChunk("tRNS", std::string("\xff\0", 2), &png);
    add({0, 1});
  } else if (colour_type == 2) {
    std::string key(6, '\0');
    key[3] = '\xff';
    if (bit_depth == 16) key[2] = '\xff';
    testing::AppendPngChunk("tRNS", key, &png);
    add({255, 0, 0, 0, 255, 0});
  } else {
    add({255, 0, 0, 255, 0, 255, 0, 0});
  }
  uLongf size = packed.size();
  compress(reinterpret_cast<Bytef*>(packed.data()), &size,
           reinterpret_cast<const Bytef*>(row.data()), static_cast<uLong>(row.size()));
  testing::AppendPngChunk("IDAT", packed.substr(0, size), &png);
  testing::AppendPngChunk("IEND", "", &png);
  return png;
}

TEST(DecodePhoto, KeepsTransparencyOfEachKindOfPng) {
  const TempFolder folder;
  const std::pair<int, int> kinds[] = {{6, 8}, {6, 16}, {2, 8}, {2, 16}, {3, 8}};
  for (const auto& [colour_type, bit_depth] : kinds) {
    WriteBytes(folder / "a.png", RedAndTransparent(colour_type, bit_depth));
    std::vector<uint8_t> transparent;
    ASSERT_OK_AND_ASSIGN(const Image image, DecodePhoto(folder / "a.png", "a.png", &transparent));
    EXPECT_EQ(transparent, (std::vector<uint8_t>{0, 1})) << colour_type << " " << bit_depth;
    EXPECT_EQ(std::vector(image.pixels.begin(), image.pixels.begin() + 3),
              (std::vector<uint8_t>{255, 0, 0}))
        << colour_type << " " << bit_depth;
  }
}

TEST(DecodePhoto, IgnoresTheOrientationTag) {
  // An Exif segment with orientation 6 (rotate by 90 degrees), after the JPEG's start marker.
  const unsigned char exif[] = {0xFF, 0xE1, 0, 34, 'E', 'x', 'i', 'f', 0,    0,    'M', 'M',
                                0,    42,   0, 0,  0,   8,   0,   1,   0x01, 0x12, 0,   3,
                                0,    0,    0, 1,  0,   6,   0,   0,   0,    0,    0,   0};
  std::string bytes = Jpeg(Picture(60, 35));
  bytes.insert(2, reinterpret_cast<const char*>(exif), sizeof(exif));
  ASSERT_OK_AND_ASSIGN(const Image image, Decode(bytes, "a.jpg"));
  EXPECT_EQ(image.width, 60);
  EXPECT_EQ(image.height, 35);
}

TEST(DecodePhoto, RejectsFilesThatAreCutShort) {
  for (const std::string& good : {Jpeg(Picture(200, 150)), Png(Picture(200, 150))}) {
    for (int twentieth = 0; twentieth < 20; ++twentieth) {
      const std::string cut = good.substr(0, good.size() * twentieth / 20);
      EXPECT_STATUS(Decode(cut, "cut.img"), kInvalidArgument, "cut.img: ");
    }
    EXPECT_STATUS(Decode(good.substr(0, good.size() - 2), "cut.img"), kInvalidArgument,
                  "file is cut short");
  }
}

TEST(DecodePhoto, RejectsOtherFormatsWhateverTheirName) {
  EXPECT_STATUS(Decode("GIF89a...............", "a.jpg"), kInvalidArgument,
                "a.jpg: not a JPEG, PNG, WebP or HEIC");
  EXPECT_STATUS(Decode("BM" + std::string(100, '\0'), "a.png"), kInvalidArgument, "a.png");
  EXPECT_STATUS(Decode("P6 2 2 255 aaaaaaaaaaaa", "a.png"), kInvalidArgument, "a.png");
  EXPECT_STATUS(Decode("", "a.png"), kInvalidArgument, "a.png");
}

std::string PngChunk(const std::string& type, const std::string& data) {
  const auto big_endian = [](uint32_t value) {
    return std::string{static_cast<char>(value >> 24), static_cast<char>(value >> 16),
                       static_cast<char>(value >> 8), static_cast<char>(value)};
  };
  const std::string body = type + data;
  const auto crc =
      crc32(0, reinterpret_cast<const Bytef*>(body.data()), static_cast<uInt>(body.size()));
  return big_endian(static_cast<uint32_t>(data.size())) + body +
         big_endian(static_cast<uint32_t>(crc));
}

// Returns a valid black PNG of side x side pixels with one bit each: a billion pixels in about
// 125 KB.
std::string BlackOneBitPng(uint16_t side) {
  const std::string row(1 + (side + 7) / 8, '\0');
  std::string raw;
  for (int y = 0; y < side; ++y) raw += row;
  uLongf size = compressBound(raw.size());
  std::string packed(size, '\0');
  compress(reinterpret_cast<Bytef*>(packed.data()), &size,
           reinterpret_cast<const Bytef*>(raw.data()), raw.size());
  packed.resize(size);
  const std::string edge = {0, 0, static_cast<char>(side >> 8), static_cast<char>(side)};
  return "\x89PNG\r\n\x1a\n" + PngChunk("IHDR", edge + edge + std::string("\1\0\0\0\0", 5)) +
         PngChunk("IDAT", packed) + PngChunk("IEND", "");
}

// Returns a PNG of one row with these samples of 16 bits. colour_type: 4 grey and alpha, 6 RGBA.
std::string SixteenBitPng(uint8_t colour_type, const std::vector<uint16_t>& samples) {
  const size_t channels = colour_type == 6 ? 4 : 2;
  std::string header(13, '\0'), row(1, '\0');
  header[3] = static_cast<char>(samples.size() / channels);
  header[7] = 1;
  header[8] = 16;
  header[9] = static_cast<char>(colour_type);
  for (const uint16_t sample : samples) {
    row += static_cast<char>(sample >> 8);
    row += static_cast<char>(sample & 0xff);
  }
  std::string packed(compressBound(row.size()), '\0');
  uLongf size = packed.size();
  compress(reinterpret_cast<Bytef*>(packed.data()), &size,
           reinterpret_cast<const Bytef*>(row.data()), row.size());
  return "\x89PNG\r\n\x1a\n" + PngChunk("IHDR", header) + PngChunk("IDAT", packed.substr(0, size)) +
         PngChunk("IEND", "");
}

// Alpha of 16 bits counts as that of 8 bits does.
TEST(DecodePhoto, KeepsAlphaOfSixteenBits) {
  const TempFolder folder;
  constexpr uint16_t kOne = 257;  // one step of 8 bits
  WriteBytes(folder / "rgba.png", SixteenBitPng(6, {200 * kOne, 50 * kOne, 7 * kOne, 255 * kOne,
                                                    1 * kOne, 2 * kOne, 3 * kOne, 127 * kOne}));
  std::vector<uint8_t> transparent;
  ASSERT_OK_AND_ASSIGN(const Image image,
                       DecodePhoto(folder / "rgba.png", "rgba.png", &transparent));
  EXPECT_EQ(image.pixels, (std::vector<uint8_t>{200, 50, 7, 1, 2, 3}));
  EXPECT_EQ(transparent, (std::vector<uint8_t>{0, 1}));
  WriteBytes(folder / "grey.png", SixteenBitPng(4, {90 * kOne, 0, 80 * kOne, 65535}));
  ASSERT_OK_AND_ASSIGN(const Image grey,
                       DecodePhoto(folder / "grey.png", "grey.png", &transparent));
  EXPECT_EQ(grey.pixels, (std::vector<uint8_t>{90, 90, 90, 80, 80, 80}));
  EXPECT_EQ(transparent, (std::vector<uint8_t>{1, 0}));
}

TEST(DecodePhoto, RejectsAHugeOneBitPngBeforeDecodingIt) {
  const std::string huge = BlackOneBitPng(32000);
  EXPECT_LT(huge.size(), 200'000u);
  const std::clock_t start = std::clock();
  EXPECT_STATUS(Decode(huge, "bomb.png"), kInvalidArgument,
                "bomb.png: 32000x32000 pixels, the limit is 64000000");
  EXPECT_LT(static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC, 0.2);
  ASSERT_OK_AND_ASSIGN(const Image small, Decode(BlackOneBitPng(100), "small.png"));
  EXPECT_EQ(small.pixels, std::vector<uint8_t>(100 * 100 * 3, 0));
}

TEST(DecodePhoto, RejectsAHugeJpegByItsHeader) {
  std::string bytes = Jpeg(Picture(64, 48));
  const size_t frame = bytes.find("\xFF\xC0");
  ASSERT_NE(frame, std::string::npos);
  bytes.replace(frame + 5, 4, "\xFF\xFF\xFF\xFF");
  EXPECT_STATUS(Decode(bytes, "a.jpg"), kInvalidArgument, "65535x65535 pixels");
}

TEST(DecodeLabels, ReadsValuesOf8And16BitsAndColours) {
  const TempFolder folder;
  const Image grey{2, 2, 1, {0, 1, 200, 1}};
  WriteBytes(folder / "grey.png", Png(grey));
  ASSERT_OK_AND_ASSIGN(const LabelImage labels, DecodeLabels(folder / "grey.png", "grey.png"));
  EXPECT_EQ(labels.labels, (std::vector<uint32_t>{0, 1, 200, 1}));
  const Image colour{2, 1, 3, {0, 0, 0, 3, 2, 1}};
  WriteBytes(folder / "colour.png", Png(colour));
  ASSERT_OK_AND_ASSIGN(const LabelImage rgb, DecodeLabels(folder / "colour.png", "colour.png"));
  EXPECT_EQ(rgb.labels, (std::vector<uint32_t>{0, 0x030201}));
  // 2x1 pixels of 16 bits: 0x0102 and 0xFFFE, no filter.
  const std::string raw("\0\x01\x02\xFF\xFE", 5);
  uLongf size = compressBound(raw.size());
  std::string packed(size, '\0');
  compress(reinterpret_cast<Bytef*>(packed.data()), &size,
           reinterpret_cast<const Bytef*>(raw.data()), raw.size());
  packed.resize(size);
  WriteBytes(folder / "deep.png",
             "\x89PNG\r\n\x1a\n" +
                 PngChunk("IHDR", std::string("\0\0\0\2\0\0\0\1\x10\0\0\0\0", 13)) +
                 PngChunk("IDAT", packed) + PngChunk("IEND", ""));
  ASSERT_OK_AND_ASSIGN(const LabelImage deep, DecodeLabels(folder / "deep.png", "deep.png"));
  EXPECT_EQ(deep.labels, (std::vector<uint32_t>{0x0102, 0xFFFE}));
}

TEST(DecodeLabels, RejectsALossyFormat) {
  const TempFolder folder;
  WriteBytes(folder / "a.png", Jpeg(Picture(8, 8)));
  EXPECT_STATUS(DecodeLabels(folder / "a.png", "a.png"), kInvalidArgument, "must be a PNG");
}

TEST(EncodePng, RoundTripsSixteenBits) {
  const TempFolder folder;
  const Grey16Image grey = {3, 2, {0, 1, 255, 256, 40'000, 65'535}};
  ASSERT_OK_AND_ASSIGN(const std::string png, EncodePng(grey));
  WriteBytes(folder / "a.png", png);
  ASSERT_OK_AND_ASSIGN(const LabelImage read, DecodeLabels(folder / "a.png", "a.png"));
  EXPECT_EQ(read.width, 3);
  EXPECT_EQ(read.labels, (std::vector<uint32_t>{0, 1, 255, 256, 40'000, 65'535}));
}

TEST(EncodePng, RejectsPixelsThatDoNotFit) {
  EXPECT_STATUS(EncodePng(Grey16Image{2, 2, {1, 2, 3}}), kInvalidArgument, "2x2 with 3 pixels");
  EXPECT_STATUS(EncodePng(Grey16Image{0, 2, {}}), kInvalidArgument, "0x2");
  EXPECT_STATUS(EncodePng({2, 2, 3, std::vector<uint8_t>(11)}), kInvalidArgument, "2x2x3");
  EXPECT_STATUS(EncodePng({0, 2, 1, {}}), kInvalidArgument, "0x2x1");
}

// An image of one channel, 3 pixels wide and 2 high.
Image Letters(const std::string& text = "abcdef") {
  Image image{3, 2, 1, {}};
  image.pixels.assign(text.begin(), text.end());
  return image;
}

TEST(Upright, AppliesEachOrientation) {
  struct Case {
    int width;
    std::string pixels;
  };
  // Stored:  a b c
  //          d e f
  const std::array<Case, 8> cases = {{{3, "abcdef"},
                                      {3, "cbafed"},
                                      {3, "fedcba"},
                                      {3, "defabc"},
                                      {2, "adbecf"},
                                      {2, "daebfc"},
                                      {2, "fcebda"},
                                      {2, "cfbead"}}};
  for (int orientation = 1; orientation <= 8; ++orientation) {
    const Image turned = Upright(Letters(), orientation);
    const Case& expected = cases[static_cast<size_t>(orientation) - 1];
    EXPECT_EQ(turned.width, expected.width) << orientation;
    EXPECT_EQ(turned.height, 6 / expected.width) << orientation;
    EXPECT_EQ(std::string(turned.pixels.begin(), turned.pixels.end()), expected.pixels)
        << orientation;
  }
}

TEST(Upright, IgnoresUnknownOrientations) {
  for (const int orientation : {-1, 0, 9}) {
    EXPECT_EQ(Upright(Letters(), orientation).pixels, Letters().pixels);
  }
}

TEST(ShrunkTo, AveragesToTheLongerSide) {
  Image image{8, 4, 3, {}};
  image.pixels.assign(8 * 4 * 3, 100);
  for (size_t i = 0; i < image.pixels.size(); i += 6) image.pixels[i] = 200;  // every other red
  const Image half = ShrunkTo(image, 4);
  EXPECT_EQ(half.width, 4);
  EXPECT_EQ(half.height, 2);
  ASSERT_EQ(half.pixels.size(), 4u * 2 * 3);
  EXPECT_EQ(half.pixels[0], 150);
  EXPECT_EQ(half.pixels[1], 100);
}

TEST(ShrunkTo, NeverEnlarges) {
  EXPECT_EQ(ShrunkTo(Letters(), 0).width, 3);
  EXPECT_EQ(ShrunkTo(Letters(), 3).width, 3);
  EXPECT_EQ(ShrunkTo(Letters(), 900).width, 3);
  EXPECT_EQ(ShrunkTo(Letters(), 1).height, 1);
}

}  // namespace
}  // namespace pepeseg
