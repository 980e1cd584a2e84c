#include "core/formats/rle.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using absl::StatusCode::kInvalidArgument;

std::vector<uint8_t> Filled(const std::vector<uint32_t>& pixels, int width, int height) {
  std::vector<uint8_t> mask(static_cast<size_t>(width) * height, 0);
  for (const uint32_t pixel : pixels) mask[pixel] ^= 1;  // one listed twice would be empty
  return mask;
}

TEST(CocoRle, EncodesAsCocoDoes) {
  // Columns 000 110 011 have runs 3 2 2 2. The expected text is that of COCO's own encoder.
  EXPECT_EQ(EncodeCocoRle({{0, 1, 0, 0, 1, 1, 0, 0, 1}}, 3, 3), "3220");
  EXPECT_EQ(EncodeCocoRle({{1, 1}}, 2, 1), "02");
  EXPECT_EQ(EncodeCocoRle({{0, 0}}, 2, 1), "2");
}

// Computes the runs pixel by pixel, down the columns.
std::vector<int64_t> NaiveCounts(const std::vector<uint8_t>& mask, int width, int height) {
  std::vector<int64_t> counts = {0};
  bool inside = false;
  for (int i = 0; i < width * height; ++i) {
    const bool set = mask[static_cast<size_t>(i % height) * width + i / height] != 0;
    if (set != inside) counts.push_back(0);
    inside = set;
    ++counts.back();
  }
  return counts;
}

TEST(CocoRle, EncodesRunsThatCrossColumnsAndWords) {
  std::mt19937 random(3);
  for (const auto& [width, height] :
       {std::pair(1, 1), {8, 3}, {23, 17}, {9, 1}, {1, 9}, {40, 40}, {32, 6}, {75, 50}}) {
    for (const int one_in : {1, 2, 9, 1000}) {
      std::vector<uint8_t> mask(static_cast<size_t>(width) * height);
      for (uint8_t& pixel : mask) pixel = random() % one_in == 0 ? 1 : 0;
      const auto counts = ParseCocoCounts(EncodeCocoRle({mask}, width, height));
      ASSERT_OK(counts);
      EXPECT_EQ(*counts, NaiveCounts(mask, width, height)) << width << "x" << height;
    }
  }
}

TEST(CocoRle, ReadsNumbersOfSeveralDigitsAndNegativeDifferences) {
  // 40 = 8 + 1 * 32, 100 = 4 + 3 * 32; then 100 - 4, and 1 as a difference of -99 to 100.
  ASSERT_OK_AND_ASSIGN(const auto counts, ParseCocoCounts("X1T34mL"));
  EXPECT_EQ(counts, (std::vector<int64_t>{40, 100, 4, 1}));
}

TEST(CocoRle, RoundTrips) {
  std::mt19937 random(3);
  for (const int width : {1, 7, 640}) {
    for (const int height : {1, 5, 333}) {
      BinaryMask mask;
      const unsigned run = 1 + random() % 40;
      for (int i = 0; i < width * height; ++i) mask.pixels.push_back(random() % run == 0 ? 1 : 0);
      ASSERT_OK_AND_ASSIGN(const auto counts, ParseCocoCounts(EncodeCocoRle(mask, width, height)));
      ASSERT_OK_AND_ASSIGN(const auto pixels, PixelsOfRuns(counts, width, height));
      EXPECT_EQ(Filled(pixels, width, height), mask.pixels);
    }
  }
}

TEST(CocoRle, GoesDownTheColumns) {
  ASSERT_OK_AND_ASSIGN(const auto pixels, PixelsOfRuns(std::vector<int64_t>{1, 3, 2}, 3, 2));
  EXPECT_EQ(pixels, (std::vector<uint32_t>{3, 1, 4}));
}

TEST(CocoRle, RejectsRunsThatDoNotFitTheImage) {
  EXPECT_STATUS(PixelsOfRuns(std::vector<int64_t>{1, 3}, 3, 2), kInvalidArgument, "4 pixels");
  EXPECT_STATUS(PixelsOfRuns(std::vector<int64_t>{1, 6}, 3, 2), kInvalidArgument, "run 1");
  EXPECT_STATUS(PixelsOfRuns(std::vector<int64_t>{7, -1}, 3, 2), kInvalidArgument, "run 0");
  EXPECT_STATUS(PixelsOfRuns(std::vector<int64_t>{1, -1, 6}, 3, 2), kInvalidArgument, "run 1");
  EXPECT_STATUS(PixelsOfRuns(std::vector<int64_t>{0, INT64_MAX, 7}, 3, 2), kInvalidArgument,
                "run 1");
}

TEST(CocoRle, RejectsMalformedStrings) {
  EXPECT_STATUS(ParseCocoCounts("3X"), kInvalidArgument, "malformed");
  EXPECT_STATUS(ParseCocoCounts("3 2"), kInvalidArgument, "malformed");
  EXPECT_STATUS(ParseCocoCounts(std::string(40, 'o')), kInvalidArgument, "malformed");
  EXPECT_STATUS(ParseCocoCounts("O"), kInvalidArgument, "length -1");
}

}  // namespace
}  // namespace pepeseg
