#include "core/query/mask_geometry.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

namespace pepeseg {
namespace {

// Returns the deepest pixel by comparing every pixel with all others and with those around the
// image.
PixelIndex NaiveDeepest(const std::vector<uint8_t>& mask, int width, int height) {
  PixelIndex deepest;
  int most = 0;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      int nearest = 1 << 30;
      for (int v = -1; v <= height; ++v) {
        for (int u = -1; u <= width; ++u) {
          const bool beyond = u < 0 || v < 0 || u == width || v == height;
          if (!beyond && mask[v * width + u] != 0) continue;
          nearest = std::min(nearest, (x - u) * (x - u) + (y - v) * (y - v));
        }
      }
      if (nearest <= most) continue;
      most = nearest;
      deepest = {x, y};
    }
  }
  return deepest;
}

TEST(FindBox, MatchesBruteForce) {
  std::mt19937 random(3);
  for (const auto& [width, height] : {std::pair(70, 23), {3, 50}, {50, 3}, {1, 1}}) {
    for (const unsigned sparsity : {1U, 12U, 900U, 1U << 30}) {
      std::vector<uint8_t> mask(static_cast<size_t>(width) * height);
      for (uint8_t& pixel : mask) pixel = random() % sparsity == 0 ? 1 : 0;
      int left = width, top = height, right = 0, bottom = 0;
      for (int i = 0; i < width * height; ++i) {
        if (mask[i] == 0) continue;
        left = std::min(left, i % width), right = std::max(right, i % width + 1);
        top = std::min(top, i / width), bottom = std::max(bottom, i / width + 1);
      }
      int box[4] = {-1, -1, -1, -1};
      FindBox(mask, width, box);
      const std::vector<int> want = right == 0
                                        ? std::vector<int>(4)
                                        : std::vector<int>{left, top, right - left, bottom - top};
      EXPECT_EQ(std::vector<int>(box, box + 4), want) << width << "x" << height << ", " << sparsity;
    }
  }
}

TEST(DeepestPixel, MatchesBruteForce) {
  std::mt19937 random(3);
  for (const auto& [width, height] : {std::pair(31, 23), {3, 50}, {50, 3}, {1, 1}}) {
    for (const unsigned sparsity : {2U, 12U, 60U, 1U << 30}) {
      std::vector<uint8_t> mask(static_cast<size_t>(width) * height);
      for (uint8_t& pixel : mask) pixel = random() % sparsity != 0 ? 1 : 0;
      if (std::count(mask.begin(), mask.end(), 1) == 0) continue;
      const PixelIndex got = DeepestPixel(mask, width, height);
      const PixelIndex want = NaiveDeepest(mask, width, height);
      EXPECT_EQ(got.x, want.x) << width << "x" << height << ", 1 in " << sparsity;
      EXPECT_EQ(got.y, want.y) << width << "x" << height << ", 1 in " << sparsity;
    }
  }
}

TEST(DeepestPixel, TakesTheFirstInReadingOrderAmongEquals) {
  constexpr int kWidth = 20, kHeight = 12;
  std::vector<uint8_t> mask(kWidth * kHeight);
  const auto fill = [&](int left, int top, int width, int height) {
    for (int y = top; y < top + height; ++y) {
      for (int x = left; x < left + width; ++x) mask[y * kWidth + x] = 1;
    }
  };
  fill(12, 2, 3, 3);  // deepest at (13, 3)
  fill(2, 6, 3, 3);   // equally deep, further left and lower
  PixelIndex deepest = DeepestPixel(mask, kWidth, kHeight);
  EXPECT_EQ(deepest.x, 13);
  EXPECT_EQ(deepest.y, 3);
  fill(5, 2, 5, 3);  // equally deep from (6, 3) to (8, 3)
  deepest = DeepestPixel(mask, kWidth, kHeight);
  EXPECT_EQ(deepest.x, 6);
  EXPECT_EQ(deepest.y, 3);
  // Everything beyond the image is outside: a full mask is deepest in its middle.
  deepest = DeepestPixel(std::vector<uint8_t>(7 * 7, 1), 7, 7);
  EXPECT_EQ(deepest.x, 3);
  EXPECT_EQ(deepest.y, 3);
}

TEST(FindDeepest, MeasuresTheSquaredDistanceToTheOutside) {
  EXPECT_EQ(FindDeepest(std::vector<uint8_t>(7 * 7), 7, 7).squared_depth, 0);
  EXPECT_EQ(FindDeepest(std::vector<uint8_t>(7 * 7, 1), 7, 7).squared_depth, 16);
  std::vector<uint8_t> pixel(7 * 7);
  pixel[3 * 7 + 2] = 1;
  const DeepPixel deepest = FindDeepest(pixel, 7, 7);
  EXPECT_EQ(deepest.squared_depth, 1);
  EXPECT_EQ(deepest.pixel.x, 2);
  EXPECT_EQ(deepest.pixel.y, 3);
}

}  // namespace
}  // namespace pepeseg
