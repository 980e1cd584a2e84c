#include "core/formats/decode_luma.h"

#include <gtest/gtest.h>

#include <random>
#include <string>
#include <vector>

#include "core/formats/images.h"
#include "tests/testing/jpeg_bytes.h"
#include "tests/testing/small_dataset.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using absl::StatusCode::kInvalidArgument;
using ::testing::Each;
using ::testing::ElementsAre;
using testing::StoredJpeg;

absl::StatusOr<Image> Decode(const std::string& bytes) {
  return DecodeLuma(std::span(reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size()),
                    "a.jpg");
}

std::string TestFile(const std::string& name) {
  return testing::ReadBytes(std::string(PEPESEG_TEST_DATA "/images/") + name);
}

Image Flat(const std::vector<uint8_t>& pixel) {
  Image image{24, 16, static_cast<int>(pixel.size()), {}};
  for (int i = 0; i < 24 * 16; ++i) {
    image.pixels.insert(image.pixels.end(), pixel.begin(), pixel.end());
  }
  return image;
}

// texture_luma.pgm is FreeImage_ConvertToGreyscale of FreeImage_Load of texture.jpg (a JPEG with
// chroma of half the size), by Debian's FreeImage 3.18.0.
TEST(DecodeLuma, HasThePixelsOfFreeImage) {
  const std::string pgm = TestFile("texture_luma.pgm");
  const std::string header = "P5 75 53 255\n";
  ASSERT_EQ(pgm.substr(0, header.size()), header);
  ASSERT_OK_AND_ASSIGN(const Image luma, Decode(TestFile("texture.jpg")));
  EXPECT_EQ(luma.width, 75);
  EXPECT_EQ(luma.height, 53);
  EXPECT_EQ(luma.channels, 1);
  const std::vector<uint8_t> expected(pgm.begin() + static_cast<ptrdiff_t>(header.size()),
                                      pgm.end());
  EXPECT_EQ(luma.pixels, expected);
}

TEST(DecodeLuma, DiffersFromTheLumaOfDecodePhoto) {
  const std::string path = PEPESEG_TEST_DATA "/images/texture.jpg";
  ASSERT_OK_AND_ASSIGN(const Image luma, DecodeLuma(path, "texture.jpg"));
  ASSERT_OK_AND_ASSIGN(Image photo, DecodePhoto(path, "texture.jpg"));
  EXPECT_NE(luma.pixels, LumaOf(std::move(photo)).pixels);
}

// Red 200, green 30, blue 60 has luma 68.3 by Rec. 709 (84.3 by the weights of JPEG).
TEST(DecodeLuma, WeighsJpegsAndPngsAlike) {
  const testing::TempFolder folder;
  testing::WriteBytes(folder / "a.png", testing::Png(Flat({200, 30, 60})));
  ASSERT_OK_AND_ASSIGN(const Image png, DecodeLuma(folder / "a.png", "a.png"));
  EXPECT_EQ(png.pixels.size(), 24u * 16);
  EXPECT_THAT(png.pixels, Each(68));
  ASSERT_OK_AND_ASSIGN(const Image jpeg, Decode(testing::Jpeg(Flat({200, 30, 60}))));
  EXPECT_EQ(jpeg.pixels.size(), 24u * 16);
  for (const uint8_t value : jpeg.pixels) ASSERT_NEAR(value, 68, 2);
}

TEST(DecodeLuma, ReadsGreyAndCmykJpegs) {
  ASSERT_OK_AND_ASSIGN(const Image grey, Decode(StoredJpeg(Flat({90}), JCS_GRAYSCALE, false)));
  EXPECT_THAT(grey.pixels, Each(90));
  // Adobe's programs store 255 - ink: red 200 * 204 / 255 = 160, green 24, blue 48.
  ASSERT_OK_AND_ASSIGN(const Image cmyk,
                       Decode(StoredJpeg(Flat({200, 30, 60, 204}), JCS_CMYK, false)));
  EXPECT_EQ(cmyk.channels, 1);
  for (const uint8_t value : cmyk.pixels) ASSERT_NEAR(value, 55, 2);
}

TEST(DecodeLuma, ReadsProgressiveJpegs) {
  ASSERT_OK_AND_ASSIGN(Image photo,
                       DecodePhoto(PEPESEG_TEST_DATA "/images/texture.jpg", "texture.jpg"));
  ASSERT_OK_AND_ASSIGN(const Image baseline, Decode(StoredJpeg(photo, JCS_RGB, false)));
  ASSERT_OK_AND_ASSIGN(const Image progressive, Decode(StoredJpeg(photo, JCS_RGB, true)));
  EXPECT_EQ(baseline.pixels, progressive.pixels);
}

TEST(DecodeLuma, RefusesJpegsThatDoNotDecode) {
  const std::string jpeg = TestFile("texture.jpg");
  for (int twentieth = 0; twentieth < 20; ++twentieth) {
    EXPECT_STATUS(Decode(jpeg.substr(0, jpeg.size() * twentieth / 20)), kInvalidArgument,
                  "a.jpg: ");
  }
  // The frame header, whose first bytes are its length, then bits a sample.
  std::string deep = jpeg;
  deep[deep.find("\xff\xc0") + 4] = 12;
  EXPECT_STATUS(Decode(deep), kInvalidArgument, "a.jpg: ");
  Image two_channels = Flat({90, 200});
  EXPECT_STATUS(Decode(StoredJpeg(two_channels, JCS_UNKNOWN, false)), kInvalidArgument,
                "not grey, RGB or CMYK");
}

// Damage in the compressed data gives a picture or an error.
TEST(DecodeLuma, SurvivesDamage) {
  std::mt19937 random(1);
  int num_decoded = 0, num_refused = 0;
  for (const bool progressive : {false, true}) {
    ASSERT_OK_AND_ASSIGN(const Image photo,
                         DecodePhoto(PEPESEG_TEST_DATA "/images/texture.jpg", "texture.jpg"));
    const std::string jpeg = StoredJpeg(photo, JCS_RGB, progressive);
    for (int i = 0; i < 400; ++i) {
      std::string damaged = jpeg;
      for (int j = 0; j < 3; ++j) damaged[random() % damaged.size()] = static_cast<char>(random());
      const auto luma = Decode(damaged);
      ++(luma.ok() ? num_decoded : num_refused);
      if (!luma.ok()) continue;
      EXPECT_EQ(luma->pixels.size(), static_cast<size_t>(luma->width) * luma->height);
    }
  }
  EXPECT_GT(num_decoded, 10);
  EXPECT_GT(num_refused, 10);
}

TEST(LumaOf, WeighsColoursAsRec709) {
  const Image luma = LumaOf({4, 1, 3, {255, 0, 0, 0, 255, 0, 0, 0, 255, 255, 255, 255}});
  EXPECT_THAT(luma.pixels, ElementsAre(54, 182, 18, 255));
}

}  // namespace
}  // namespace pepeseg
