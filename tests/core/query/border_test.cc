#include "core/query/border.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace pepeseg {
namespace {

constexpr int kWidth = 12, kHeight = 9;

// Two things with orthogonal features and different colours, side by side. `share` of the left one
// is in each column; the query is for the left one.
class BorderTest : public ::testing::Test {
 protected:
  BorderTest() {
    pixels_.width = kWidth;
    pixels_.height = kHeight;
    pixels_.features.resize(size_t{kWidth} * kHeight * kFeatureSize);
    pixels_.rgb.resize(size_t{kWidth} * kHeight * 3);
    pixels_.similarity.resize(size_t{kWidth} * kHeight);
    pixels_.threshold = 0.75;
    pixels_.psi.fill(1);
    mask_.resize(size_t{kWidth} * kHeight);
  }

  static size_t At(int x, int y) { return static_cast<size_t>(y) * kWidth + x; }

  // Gives a pixel `share` of the left thing's feature, and as much of its colour.
  void Mix(int x, int y, double share) {
    const size_t i = At(x, y);
    pixels_.features[i * kFeatureSize] = HalfFromFloat(static_cast<float>(share));
    pixels_.features[i * kFeatureSize + 1] = HalfFromFloat(static_cast<float>(1 - share));
    pixels_.similarity[i] = static_cast<float>(share / std::hypot(share, 1 - share));
    Paint(x, y, share);
  }
  void Paint(int x, int y, double share) {
    pixels_.rgb[3 * At(x, y)] = static_cast<uint8_t>(std::lround(200 * share));
    pixels_.rgb[3 * At(x, y) + 2] = static_cast<uint8_t>(std::lround(200 * (1 - share)));
  }
  void MixColumn(int x, double share) {
    for (int y = 0; y < kHeight; ++y) Mix(x, y, share);
  }
  // Columns left of `border` show the left thing.
  void Split(int border) {
    for (int x = 0; x < kWidth; ++x) MixColumn(x, x < border ? 1 : 0);
  }
  void Mark(int x, uint8_t value) {
    for (int y = 0; y < kHeight; ++y) mask_[At(x, y)] = value;
  }
  // Marks all columns left of `border` as inside.
  void MarkUntil(int border) {
    for (int x = 0; x < kWidth; ++x) Mark(x, x < border ? 1 : 0);
  }
  // Returns the number of columns inside at the left of each row, which must be the same in all.
  int Border() const {
    std::vector<int> counts;
    for (int y = 0; y < kHeight; ++y) {
      int count = 0;
      while (count < kWidth && mask_[At(count, y)] != 0) ++count;
      EXPECT_EQ(std::count(&mask_[At(0, y)], &mask_[At(0, y)] + kWidth, 1), count) << "row " << y;
      counts.push_back(count);
    }
    EXPECT_EQ(std::count(counts.begin(), counts.end(), counts[0]), kHeight);
    return counts[0];
  }

  BorderPixels pixels_;
  std::vector<uint8_t> mask_;
};

TEST_F(BorderTest, AddsAPixelThatIsMostlyInside) {
  Split(6);
  MixColumn(6, 0.7);  // similarity 0.92
  MarkUntil(6);
  pixels_.threshold = 0.95;
  RefineBorder(pixels_, mask_);
  EXPECT_EQ(Border(), 7);
}

TEST_F(BorderTest, RemovesAPixelThatIsMostlyOutside) {
  Split(6);
  MixColumn(6, 0.3);  // similarity 0.39
  MarkUntil(7);
  pixels_.threshold = 0.35;
  RefineBorder(pixels_, mask_);
  EXPECT_EQ(Border(), 6);
}

TEST_F(BorderTest, KeepsAPixelThatIsHalfInside) {
  Split(6);
  MixColumn(6, 0.5);
  for (const int border : {6, 7}) {
    MarkUntil(border);
    RefineBorder(pixels_, mask_);
    EXPECT_EQ(Border(), border);
  }
}

TEST_F(BorderTest, KeepsPixelsWhoseSimilarityIsFarFromTheThreshold) {
  Split(6);
  MixColumn(6, 0.3);
  MarkUntil(7);
  pixels_.threshold = 0.25;  // 0.14 away
  RefineBorder(pixels_, mask_);
  EXPECT_EQ(Border(), 7);
}

TEST_F(BorderTest, FollowsColourWhereFeaturesAreEqual) {
  for (int x = 0; x < kWidth; ++x) MixColumn(x, 1);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) Paint(x, y, x < 6 ? 1 : 0);
  }
  pixels_.threshold = 0.95;
  MarkUntil(7);
  RefineBorder(pixels_, mask_);
  EXPECT_EQ(Border(), 6);
}

TEST_F(BorderTest, KeepsABorderThatNothingShows) {
  for (int x = 0; x < kWidth; ++x) MixColumn(x, 1);
  pixels_.threshold = 0.95;
  MarkUntil(7);
  RefineBorder(pixels_, mask_);
  EXPECT_EQ(Border(), 7);
}

TEST_F(BorderTest, GatesFeatures) {
  Split(6);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) Paint(x, y, 1);
  }
  MarkUntil(7);
  std::fill(pixels_.similarity.begin(), pixels_.similarity.end(), 0.75f);
  BorderPixels closed = pixels_;
  closed.psi = {};  // no feature passes
  std::vector<uint8_t> kept = mask_;
  RefineBorder(closed, kept);
  EXPECT_EQ(kept, mask_);
  RefineBorder(pixels_, mask_);
  EXPECT_EQ(Border(), 6);
}

// A column of one pixel has no pixel away from its border.
TEST_F(BorderTest, KeepsThinThings) {
  Split(0);
  MixColumn(5, 1);
  pixels_.threshold = 0.95;
  Mark(5, 1);
  const std::vector<uint8_t> before = mask_;
  RefineBorder(pixels_, mask_);
  EXPECT_EQ(mask_, before);
}

TEST_F(BorderTest, LeavesAFullAndAnEmptyMask) {
  Split(6);
  std::fill(pixels_.similarity.begin(), pixels_.similarity.end(), 0.75f);
  for (const uint8_t value : {0, 1}) {
    std::vector<uint8_t> mask(mask_.size(), value);
    RefineBorder(pixels_, mask);
    EXPECT_EQ(std::count(mask.begin(), mask.end(), value), kWidth * kHeight);
  }
}

// Gives the pixels arbitrary features and a square mask in the top rows.
class MixedBorderTest : public BorderTest {
 protected:
  MixedBorderTest() {
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) Mix(x, y, (7 * x + 5 * y) % 11 / 10.0);
    }
    std::fill(pixels_.similarity.begin(), pixels_.similarity.end(), 0.75f);
    for (int y = 0; y < 3; ++y) {
      for (int x = 3; x < 7; ++x) mask_[At(x, y)] = 1;
    }
  }
};

TEST_F(MixedBorderTest, ChangesOnlyPixelsAtTheBorder) {
  const std::vector<uint8_t> before = mask_;
  RefineBorder(pixels_, mask_);
  EXPECT_NE(mask_, before);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const bool around = y < 4 && x >= 2 && x < 8;
      const bool deep = y < 2 && x >= 4 && x < 6;  // the top of the image is not a border
      if (around && !deep) continue;
      EXPECT_EQ(mask_[At(x, y)], before[At(x, y)]) << x << ", " << y;
    }
  }
}

// A crop with a margin of kBorderReach gives what the whole view gives.
TEST_F(MixedBorderTest, ReadsNothingBeyondItsReach) {
  BorderPixels crop = pixels_;
  crop.height = 3 + kBorderReach;
  ASSERT_LT(crop.height, kHeight);
  std::vector<uint8_t> cropped(mask_.begin(), mask_.begin() + crop.height * kWidth);
  RefineBorder(crop, cropped);
  RefineBorder(pixels_, mask_);
  EXPECT_TRUE(std::equal(cropped.begin(), cropped.end(), mask_.begin()));
}

}  // namespace
}  // namespace pepeseg
