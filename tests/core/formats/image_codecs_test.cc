// Kinds of files that the libraries of the formats read, and their reports about damaged ones.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include <string>
#include <vector>

#include "core/formats/images.h"
#include "tests/testing/jpeg_bytes.h"
#include "tests/testing/png_bytes.h"
#include "tests/testing/small_dataset.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using ::testing::Each;
using ::testing::ElementsAre;

absl::StatusOr<Image> Photo(const std::string& bytes) {
  return DecodePhoto(std::span(reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size()), "a");
}

// Returns a JPEG of 16x16 equal pixels in the colour space that is stored.
std::string FlatJpeg(const std::vector<uint8_t>& pixel, J_COLOR_SPACE space, bool progressive) {
  constexpr int kFlatSide = 16;
  Image image{kFlatSide, kFlatSide, static_cast<int>(pixel.size()), {}};
  for (int i = 0; i < kFlatSide * kFlatSide; ++i) {
    image.pixels.insert(image.pixels.end(), pixel.begin(), pixel.end());
  }
  return testing::StoredJpeg(image, space, progressive);
}

TEST(ImageCodecs, ReadGreyRgbAndCmykJpegs) {
  for (const bool scans : {false, true}) {
    ASSERT_OK_AND_ASSIGN(const Image grey, Photo(FlatJpeg({90}, JCS_GRAYSCALE, scans)));
    EXPECT_EQ(grey.channels, 3);
    EXPECT_THAT(grey.pixels, Each(90));
    ASSERT_OK_AND_ASSIGN(const Image rgb, Photo(FlatJpeg({200, 30, 60}, JCS_RGB, scans)));
    EXPECT_NEAR(rgb.pixels[0], 200, 2);
    EXPECT_NEAR(rgb.pixels[1], 30, 2);
    EXPECT_NEAR(rgb.pixels[2], 60, 2);
    // Inverted, as Adobe's programs store them: colour times black.
    ASSERT_OK_AND_ASSIGN(const Image cmyk, Photo(FlatJpeg({200, 30, 60, 204}, JCS_CMYK, scans)));
    EXPECT_EQ(cmyk.pixels.size(), 3u * 16 * 16);
    EXPECT_NEAR(cmyk.pixels[0], 161, 2);
    EXPECT_NEAR(cmyk.pixels[1], 25, 2);
    EXPECT_NEAR(cmyk.pixels[2], 49, 2);
  }
}

// Each of the first pixel, the rest of its row and the second row is a pass of its own.
TEST(ImageCodecs, ReadInterlacedPngs) {
  const std::string rows("\0\x0a\0\x14\0\x1e\x28", 7);
  std::string png = testing::GreyPng(2, 2, 8, rows);
  constexpr size_t kHeaderType = 12, kHeaderBytes = 17, kInterlace = 28, kHeaderCrc = 29;
  png[kInterlace] = 1;
  std::string crc;
  testing::AppendBigEndian(
      static_cast<uint32_t>(
          crc32(0, reinterpret_cast<const Bytef*>(png.data() + kHeaderType), kHeaderBytes)),
      &crc);
  png.replace(kHeaderCrc, crc.size(), crc);
  ASSERT_OK_AND_ASSIGN(const FloatImage grey,
                       DecodeGrey({reinterpret_cast<const uint8_t*>(png.data()), png.size()}, "a"));
  EXPECT_THAT(grey.values, ElementsAre(10, 20, 30, 40));
}

TEST(ImageCodecs, ReadPngsOfFewBits) {
  const std::string one = testing::GreyPng(2, 1, 1, std::string("\0\x40", 2));
  ASSERT_OK_AND_ASSIGN(const Image image, Photo(one));
  EXPECT_THAT(image.pixels, ElementsAre(0, 0, 0, 255, 255, 255));
  const std::string two = testing::RawPng(2, 1, {2, 3, std::string("\1\2\3\4\5\6\7\x8\x9", 9)},
                                          std::string("\0\x90", 2));
  ASSERT_OK_AND_ASSIGN(const Image palette, Photo(two));
  EXPECT_THAT(palette.pixels, ElementsAre(7, 8, 9, 4, 5, 6));
}

TEST(ImageCodecs, SayWhatIsDamagedAndPrintNothing) {
  std::string png = testing::GreyPng(2, 2, 8, std::string("\0\1\2\0\3\4", 6));
  png[png.find("IDAT") + 8] ^= 1;
  std::string jpeg = testing::Jpeg(testing::Picture(32, 32));
  jpeg.replace(jpeg.find("\xff\xc4") + 5, 16, 16, '\xff');  // counts of the codes of each length
  ::testing::internal::CaptureStderr();
  EXPECT_STATUS(Photo(png), absl::StatusCode::kInvalidArgument, "a: does not decode: IDAT: ");
  EXPECT_STATUS(Photo(jpeg), absl::StatusCode::kInvalidArgument,
                "a: does not decode: Bogus Huffman table definition");
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
}

TEST(ImageCodecs, RefuseAnimatedWebp) {
  std::string webp("RIFF\x20\0\0\0WEBPVP8X\x0a\0\0\0\2\0\0\0\7\0\0\7\0\0", 30);
  webp += std::string("ANIM\0\0\0\0\0\0", 10);
  EXPECT_STATUS(Photo(webp), absl::StatusCode::kInvalidArgument,
                "a: does not decode: it is an animation");
}

}  // namespace
}  // namespace pepeseg
