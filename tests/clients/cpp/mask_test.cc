#include "clients/cpp/mask.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "tests/testing/status_testing.h"

namespace pepeseg::client {
namespace {

v1::CocoRle Rle(int height, int width, const std::string& counts) {
  v1::CocoRle rle;
  rle.set_height(height);
  rle.set_width(width);
  rle.set_counts(counts);
  return rle;
}

// Encodes runs by COCO's rule: from the fourth run on the difference to the run before the last,
// five bits a character, with the sign in the last character.
std::string Encode(const std::vector<int64_t>& runs) {
  std::string text;
  for (size_t i = 0; i < runs.size(); ++i) {
    int64_t x = runs[i] - (i > 2 ? runs[i - 2] : 0);
    for (bool more = true; more;) {
      int64_t symbol = x & 31;
      x >>= 5;
      more = (symbol & 16) != 0 ? x != -1 : x != 0;
      text.push_back(static_cast<char>((more ? symbol | 32 : symbol) + '0'));
    }
  }
  return text;
}

TEST(DecodeRle, IsColumnMajorAndStartsWithZeros) {
  const auto mask = DecodeRle(Rle(2, 3, "132"));  // runs 1, 3, 2
  ASSERT_OK(mask);
  EXPECT_EQ(*mask, (Mask{0, 1, 0, 1, 1, 0}));
}

TEST(DecodeRle, ReadsLongRunsAndDifferences) {
  std::mt19937 random(3);
  for (int round = 0; round < 20; ++round) {
    constexpr int kHeight = 37;
    constexpr int kWidth = 90;
    std::vector<int64_t> runs;
    Mask expected(kHeight * kWidth);
    int64_t filled = 0;
    while (filled < kHeight * kWidth) {
      const int64_t run =
          std::min<int64_t>(kHeight * kWidth - filled, 1 + static_cast<int64_t>(random() % 400));
      for (int64_t k = filled; k < filled + run; ++k) {
        expected[(k % kHeight) * kWidth + k / kHeight] = runs.size() % 2;
      }
      filled += run;
      runs.push_back(run);
    }
    const auto mask = DecodeRle(Rle(kHeight, kWidth, Encode(runs)));
    ASSERT_OK(mask);
    EXPECT_EQ(*mask, expected);
  }
}

TEST(DecodeRle, ReadsRunsThatEndWithAColumn) {
  const auto columns = DecodeRle(Rle(2, 3, Encode({2, 2, 2})));
  ASSERT_OK(columns);
  EXPECT_EQ(*columns, (Mask{0, 1, 0, 0, 1, 0}));
  const auto all = DecodeRle(Rle(2, 3, Encode({0, 6})));
  ASSERT_OK(all);
  EXPECT_EQ(*all, Mask(6, 1));
  const auto empty = DecodeRle(Rle(2, 3, Encode({1, 0, 5})));
  ASSERT_OK(empty);
  EXPECT_EQ(*empty, Mask(6, 0));
}

TEST(EncodeRle, IsWhatDecodeRleReads) {
  EXPECT_EQ(EncodeRle(Mask{0, 1, 0, 1, 1, 0}, 3, 2).counts(), "132");
  std::mt19937 random(5);
  for (const unsigned share : {0u, 1u, 30u, 99u, 100u}) {
    Mask mask(37 * 90);
    for (uint8_t& pixel : mask) pixel = random() % 100 < share ? 1 : 0;
    const auto decoded = DecodeRle(EncodeRle(mask, 90, 37));
    ASSERT_OK(decoded);
    EXPECT_EQ(*decoded, mask) << share;
  }
}

TEST(DecodeRle, RefusesRunsThatDoNotFillTheMask) {
  for (const char* counts : {"", "13", "139", "1", "P", "ooooooooooooooooooooo"}) {
    EXPECT_EQ(DecodeRle(Rle(2, 3, counts)).status().code(), absl::StatusCode::kDataLoss) << counts;
  }
  EXPECT_FALSE(DecodeRle(Rle(-2, 3, "6")).ok());
  EXPECT_FALSE(DecodeRle(Rle(2000000, 2000000, "6")).ok());
}

}  // namespace
}  // namespace pepeseg::client
