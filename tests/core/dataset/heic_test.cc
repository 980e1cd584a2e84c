// Both test files show red 40 + 2 x, green 40 + 3 y, blue 90 in 96x64 stored pixels (heif-enc -q
// 60). gradient_turned.heic also has EXIF data of a phone with orientation 6, and a property that
// rotates the pixels clockwise by 90 degrees, like files of iPhones.
#include "core/formats/heic.h"

#include <gtest/gtest.h>

#include <string>

#include "core/formats/exif.h"
#include "core/formats/heic_header.h"
#include "core/formats/image_header.h"
#include "core/formats/images.h"
#include "tests/testing/small_dataset.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using absl::StatusCode::kInvalidArgument;

constexpr char kFlat[] = PEPESEG_TEST_DATA "/images/gradient.heic";
constexpr char kTurned[] = PEPESEG_TEST_DATA "/images/gradient_turned.heic";

std::span<const uint8_t> Span(const std::string& bytes) {
  return {reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size()};
}

void ExpectPixel(const Image& image, int x, int y, int red, int green) {
  const size_t at = 3 * (static_cast<size_t>(y) * image.width + x);
  EXPECT_NEAR(image.pixels[at], red, 12) << x << ", " << y;
  EXPECT_NEAR(image.pixels[at + 1], green, 12) << x << ", " << y;
  EXPECT_NEAR(image.pixels[at + 2], 90, 12) << x << ", " << y;
}

TEST(DecodeHeic, ReadsPixelsAsStored) {
  ASSERT_OK_AND_ASSIGN(const HeicPhoto photo, DecodeHeic(Span(testing::ReadBytes(kFlat)), "a"));
  ASSERT_EQ(photo.image.width, 96);
  ASSERT_EQ(photo.image.height, 64);
  ExpectPixel(photo.image, 10, 50, 60, 190);
  ExpectPixel(photo.image, 80, 5, 200, 55);
  EXPECT_EQ(photo.exif, "");
}

TEST(DecodeHeic, RotatesOnlyOnce) {
  ASSERT_OK_AND_ASSIGN(const HeicPhoto photo, DecodeHeic(Span(testing::ReadBytes(kTurned)), "a"));
  ASSERT_EQ(photo.image.width, 64);
  ASSERT_EQ(photo.image.height, 96);
  ExpectPixel(photo.image, 63 - 50, 10, 60, 190);  // what was stored at (10, 50)
  ExpectPixel(photo.image, 63 - 5, 80, 200, 55);
}

TEST(HeicToJpeg, KeepsTheCameraAndSetsTheOrientation) {
  ASSERT_OK_AND_ASSIGN(const std::string jpeg,
                       HeicToJpeg(Span(testing::ReadBytes(kTurned)), "a.heic"));
  const ExifCamera camera = ReadExifCamera(Span(jpeg));
  EXPECT_EQ(camera.maker, "Fruit");
  EXPECT_EQ(camera.model, "Phone 1");
  EXPECT_EQ(ReadExifOrientation(Span(jpeg)), 1);
  ASSERT_OK_AND_ASSIGN(const Image image, DecodePhoto(Span(jpeg), "a.jpg"));
  ASSERT_EQ(image.height, 96);
  ExpectPixel(image, 63 - 50, 10, 60, 190);
}

TEST(ReadImageHeader, RecognisesHeicAndReturnsTheRotatedSize) {
  ASSERT_OK_AND_ASSIGN(const ImageHeader flat,
                       ReadImageHeader("a", Span(testing::ReadBytes(kFlat))));
  EXPECT_EQ(flat.format, ImageFormat::kHeic);
  EXPECT_EQ(flat.width, 96);
  ASSERT_OK_AND_ASSIGN(const ImageHeader turned,
                       ReadImageHeader("a", Span(testing::ReadBytes(kTurned))));
  EXPECT_EQ(turned.width, 64);
  EXPECT_EQ(turned.height, 96);
  ASSERT_OK_AND_ASSIGN(const ImageHeader size, ReadImageSize(kTurned, "a"));
  EXPECT_EQ(size.format, ImageFormat::kHeic);
  EXPECT_EQ(size.height, 96);
}

TEST(DecodeHeic, RejectsFilesThatAreCutShort) {
  const std::string good = testing::ReadBytes(kTurned);
  for (size_t size = 0; size < good.size(); ++size) {
    EXPECT_STATUS(DecodeHeic(Span(good).first(size), "cut.heic"), kInvalidArgument, "cut.heic: ");
  }
}

TEST(DecodeHeic, RejectsTooManyPixelsByTheHeader) {
  std::string bomb = testing::ReadBytes(kFlat);
  const size_t size = bomb.find("ispe") + 8;
  for (const size_t at : {size, size + 4}) bomb.replace(at, 4, std::string("\0\0\xff\xff", 4));
  EXPECT_STATUS(DecodeHeic(Span(bomb), "bomb.heic"), kInvalidArgument,
                "bomb.heic: 65535x65535 pixels, the limit is 64000000");
}

// Fails under the address sanitizer if a read leaves the buffer.
TEST(DecodeHeic, SurvivesEveryChangedByte) {
  const std::string good = testing::ReadBytes(kTurned);
  for (size_t i = 0; i < good.size(); ++i) {
    std::string changed = good;
    changed[i] = static_cast<char>(changed[i] ^ 0xff);
    const auto photo = DecodeHeic(Span(changed), "a.heic");
    if (photo.ok()) {
      EXPECT_EQ(photo->image.pixels.size(), 64u * 96 * 3);
    }
  }
}

TEST(IsHeic, RejectsAvifAndVideos) {
  const auto begins = [](const std::string& brand) {
    return IsHeic(Span(std::string("\0\0\0\x1c", 4) + "ftyp" + brand));
  };
  for (const char* brand : {"heic", "heix", "mif1"}) EXPECT_TRUE(begins(brand)) << brand;
  for (const char* brand : {"avif", "isom", "qt  ", "mp42", ""}) EXPECT_FALSE(begins(brand));
}

}  // namespace
}  // namespace pepeseg
