#include "core/features/mask_scales.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace pepeseg {
namespace {

constexpr int kMaskWidth = 40, kMaskHeight = 30;

// Returns a view of a wall at distance 2 with a focal length of 20 pixels: a pixel is 0.1 wide
// there.
View WallView(const std::vector<BinaryMask>& masks) {
  View view;
  view.camera = {kMaskWidth, kMaskHeight, 20, 20, 17, 14};
  view.masks = BuildMaskSet(kMaskWidth, kMaskHeight, masks);
  return view;
}

// Returns the mask of [x0, x1) x [y0, y1).
BinaryMask Rectangle(int x0, int y0, int x1, int y1) {
  BinaryMask mask;
  for (int y = 0; y < kMaskHeight; ++y) {
    for (int x = 0; x < kMaskWidth; ++x) {
      mask.pixels.push_back(x >= x0 && x < x1 && y >= y0 && y < y1);
    }
  }
  return mask;
}

// Depth of the wall.
const std::vector<float> kWall(kMaskWidth* kMaskHeight, 2.0f);

TEST(MaskScales, AreTwiceTheSpreadInSpace) {
  // The majority filter removes the corners of the rectangle.
  const View view = WallView({Rectangle(3, 4, 23, 14)});
  double xx = 0, yy = 0, count = 0;
  for (int y = 4; y < 14; ++y) {
    for (int x = 3; x < 23; ++x) {
      if ((x == 3 || x == 22) && (y == 4 || y == 13)) continue;
      xx += std::pow((x - 12.5) * 0.1, 2);
      yy += std::pow((y - 8.5) * 0.1, 2);
      ++count;
    }
  }
  EXPECT_NEAR(MaskScales(view, kWall)[0], 2 * std::sqrt((xx + yy) / count), 1e-5);
}

TEST(MaskScales, GrowWithTheDistance) {
  const View view = WallView({Rectangle(3, 4, 23, 14)});
  const std::vector<float> far(kMaskWidth * kMaskHeight, 6.0f);
  EXPECT_NEAR(MaskScales(view, far)[0], 3 * MaskScales(view, kWall)[0], 1e-4);
}

TEST(MaskScales, AreMissingUnderEightPixels) {
  const View view = WallView({Rectangle(3, 4, 6, 7), Rectangle(20, 4, 24, 8)});
  const std::vector<float> scales = MaskScales(view, kWall);
  EXPECT_EQ(scales[0], kNoScale);  // 9 pixels without 4 corners
  EXPECT_GT(scales[1], 0);         // 16 without 4
}

TEST(MaskScales, LeaveThinLinesOut) {
  const View view = WallView({Rectangle(3, 4, 33, 5)});
  EXPECT_EQ(MaskScales(view, kWall)[0], kNoScale);
}

TEST(MaskScales, LeaveOutPixelsThatHaveNoDepthOrAreIgnored) {
  View view = WallView({Rectangle(3, 4, 23, 14)});
  std::vector<float> half = kWall;
  view.ignore.assign(half.size(), 0);
  for (size_t i = 0; i < half.size(); ++i) {
    if (i % kMaskWidth >= 13) half[i] = 0;
  }
  const float narrow = MaskScales(view, half)[0];
  EXPECT_LT(narrow, MaskScales(view, kWall)[0]);
  for (size_t i = 0; i < half.size(); ++i) view.ignore[i] = i % kMaskWidth >= 13 ? 255 : 0;
  EXPECT_EQ(MaskScales(view, kWall)[0], narrow);
  EXPECT_EQ(MaskScales(view, std::vector<float>(half.size()))[0], kNoScale);
}

TEST(ScaleQuantiles, RunFromTheSmallestToTheLargest) {
  const std::vector<float> knots = ScaleQuantiles({4, 0, 1, 2});
  ASSERT_EQ(knots.size(), 1000u);
  EXPECT_EQ(knots.front(), 1);
  EXPECT_EQ(knots.back(), 4);
  EXPECT_TRUE(std::is_sorted(knots.begin(), knots.end()));
  EXPECT_NEAR(knots[250], 1 + 2 * 250 / 999.0, 1e-5);
  EXPECT_TRUE(ScaleQuantiles({0, 0}).empty());
}

TEST(EvenScales, RunEvenlyFromTheSmallestToTheNinetyNinthPercentile) {
  std::vector<float> scales = {0, 1000};
  for (int i = 1; i <= 200; ++i) scales.push_back(static_cast<float>(i));
  const std::vector<float> knots = EvenScales(scales);
  ASSERT_EQ(knots.size(), 1000u);
  EXPECT_EQ(knots.front(), 1);
  EXPECT_EQ(knots.back(), 199);  // at index 0.99 * 200 of the sorted scales
  EXPECT_NEAR(knots[333], 1 + 198 / 3.0, 1e-4);
  EXPECT_TRUE(EvenScales({0}).empty());
}

TEST(MinMaxScales, RunEvenlyFromTheSmallestToTheLargest) {
  const std::vector<float> knots = MinMaxScales({5, 0, 2, 2, 1001});
  ASSERT_EQ(knots.size(), 1000u);
  EXPECT_EQ(knots.front(), 2);
  EXPECT_EQ(knots[333], 2 + 333);
  EXPECT_EQ(knots.back(), 1001);
  EXPECT_TRUE(MinMaxScales({0}).empty());
}

// Returns overlapping rectangles with holes. None is empty.
std::vector<BinaryMask> RandomMasks(int width, int height, int count, std::mt19937_64& random) {
  std::vector<BinaryMask> masks(count);
  for (BinaryMask& mask : masks) {
    const int x0 = static_cast<int>(random() % width), y0 = static_cast<int>(random() % height);
    const int x1 = x0 + 1 + static_cast<int>(random() % width);
    const int y1 = y0 + 1 + static_cast<int>(random() % height);
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const bool inside = x >= x0 && x < x1 && y >= y0 && y < y1;
        mask.pixels.push_back(inside && random() % 8 != 0);
      }
    }
    mask.pixels[size_t(y0) * width + x0] = 1;
  }
  return masks;
}

// Returns a scale for each mask. Some are equal, some are kNoScale.
std::vector<float> RandomScales(size_t count, std::mt19937_64& random) {
  std::vector<float> scales;
  for (size_t i = 0; i < count; ++i) {
    scales.push_back(random() % 8 == 0 ? 0.0f : 0.1f * static_cast<float>(1 + random() % 100));
  }
  return scales;
}

// Returns the scale of each mask, some random scales, one below and one above all masks.
std::vector<float> TestedScales(const std::vector<float>& mask_scales, std::mt19937_64& random) {
  std::vector<float> tested = mask_scales;
  for (int i = 0; i < 10; ++i) tested.push_back(0.011f * static_cast<float>(random() % 1000));
  tested.push_back(0.05f);
  tested.push_back(11);
  return tested;
}

// The paper's G, computed from the masks' pixels.
struct PaperPairs {
  const std::vector<BinaryMask>& masks;
  const std::vector<float>& scales;

  bool Covers(size_t mask, size_t pixel) const {
    return scales[mask] > 0 && masks[mask].pixels[pixel] != 0;
  }
  // Returns Lambda(s, p): the finest mask over p that is not smaller than s, the first of equal
  // ones, or -1.
  int Lambda(float s, size_t pixel) const {
    int best = -1;
    for (size_t mask = 0; mask < masks.size(); ++mask) {
      if (!Covers(mask, pixel) || scales[mask] < s) continue;
      if (best < 0 || scales[mask] < scales[best]) best = static_cast<int>(mask);
    }
    return best;
  }
  // Returns G: "Lambda(s,p) = Lambda(s,q), or a shared finer mask". A Lambda of -1 equals nothing.
  bool Together(float s, size_t p, size_t q) const {
    if (Lambda(s, p) >= 0 && Lambda(s, p) == Lambda(s, q)) return true;
    for (size_t mask = 0; mask < masks.size(); ++mask) {
      if (scales[mask] < s && Covers(mask, p) && Covers(mask, q)) return true;
    }
    return false;
  }
};

bool Intersect(const std::vector<uint64_t>& a, const std::vector<uint64_t>& b) {
  uint64_t common = 0;
  for (size_t word = 0; word < a.size(); ++word) common |= a[word] & b[word];
  return common != 0;
}

TEST(ScaleLabels, IntersectAsThePaperPairsPixels) {
  constexpr int kColumns = 12, kLines = 9;
  std::mt19937_64 random(7);
  int together = 0, apart = 0;
  for (int trial = 0; trial < 24; ++trial) {
    // In some trials the bitsets have two words.
    const auto masks = RandomMasks(kColumns, kLines, trial % 4 == 0 ? 90 : 1 + trial / 2, random);
    const MaskSet set = BuildMaskSet(kColumns, kLines, masks, /*duplicate_iou=*/1);
    ASSERT_EQ(set.num_masks, masks.size());
    const std::vector<float> scales = RandomScales(masks.size(), random);
    std::vector<int> pixels(20);
    for (int& pixel : pixels) pixel = static_cast<int>(random() % (kColumns * kLines));
    for (const float s : TestedScales(scales, random)) {
      std::vector<std::vector<uint64_t>> labels;
      for (const int p : pixels) {
        labels.emplace_back(set.words);
        ScaleLabels(set.BitsAt(p % kColumns, p / kColumns), scales, s, labels.back());
      }
      for (size_t i = 0; i < pixels.size(); ++i) {
        for (size_t j = i; j < pixels.size(); ++j) {  // also a pixel with itself
          const bool want = PaperPairs{masks, scales}.Together(s, pixels[i], pixels[j]);
          ASSERT_EQ(Intersect(labels[i], labels[j]), want)
              << "trial " << trial << ", scale " << s << ", " << pixels[i] << " and " << pixels[j];
          ++(want ? together : apart);
        }
      }
    }
  }
  EXPECT_GT(together, 10000);
  EXPECT_GT(apart, 10000);
}

TEST(ScaleLabels, KeepAllMasksAboveTheLargestScale) {
  const std::vector<uint64_t> bits = {0b1011};
  const std::vector<float> scales = {1, 2, 3, 0};
  std::vector<uint64_t> out(1);
  ScaleLabels(bits, scales, 9, out);
  EXPECT_EQ(out[0], 0b0011u);  // mask 2 does not cover the pixels, mask 3 has no scale
  ScaleLabels(bits, scales, 0.5f, out);
  EXPECT_EQ(out[0], 0b0001u);
  ScaleLabels(bits, scales, 1.5f, out);
  EXPECT_EQ(out[0], 0b0011u);
}

}  // namespace
}  // namespace pepeseg
