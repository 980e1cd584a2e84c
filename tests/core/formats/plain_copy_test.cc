#include "core/formats/plain_copy.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

#include "core/formats/exif.h"
#include "core/formats/image_header.h"
#include "core/formats/images.h"
#include "tests/testing/small_dataset.h"
#include "tests/testing/status_testing.h"

// Which kinds of files are copied is in image_kinds_test.cc.
namespace pepeseg {
namespace {

using Bytes = std::vector<uint8_t>;

Bytes BytesOf(const std::string& text) { return {text.begin(), text.end()}; }

// Returns a JPEG of 8x6 pixels with an EXIF orientation.
Bytes TurnedJpeg(char orientation) {
  std::string exif(
      "\xff\xe1\0\x22"
      "Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0",
      36);
  exif[29] = orientation;
  std::string jpeg = testing::Jpeg(testing::Picture(8, 6));
  return BytesOf(jpeg.insert(2, exif));
}

TEST(PlainCopy, IsUpright) {
  const Bytes jpeg = TurnedJpeg(6);
  ASSERT_EQ(ReadExifOrientation(jpeg), 6);
  ASSERT_OK_AND_ASSIGN(const std::string copy, PlainCopy(jpeg, "photo"));
  ASSERT_OK_AND_ASSIGN(const ImageHeader header, ReadImageHeader("copy", BytesOf(copy)));
  EXPECT_EQ(header.format, ImageFormat::kJpeg);
  EXPECT_EQ(header.width, 6);
  EXPECT_EQ(header.height, 8);
  EXPECT_EQ(ReadExifOrientation(BytesOf(copy)), 1) << "nobody turns it twice";
  EXPECT_FALSE(ReadExifData(BytesOf(copy)).empty());
}

TEST(PlainCopy, KeepsStoredPixelsOnRequest) {
  ASSERT_OK_AND_ASSIGN(const std::string copy, PlainCopy(TurnedJpeg(6), "a", {.upright = false}));
  EXPECT_TRUE(copy.empty());
}

}  // namespace
}  // namespace pepeseg
