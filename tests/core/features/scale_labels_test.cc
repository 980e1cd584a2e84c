#include "core/features/scale_labels.h"

#include <gtest/gtest.h>

#include <random>

namespace pepeseg {
namespace {

// Overlapping rectangles with holes, [height, width] each.
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
    mask.pixels[size_t(y0) * width + x0] = 1;  // none is empty
  }
  return masks;
}

// Some scales are the same, some masks have none.
std::vector<float> RandomScales(size_t count, std::mt19937_64& random) {
  std::vector<float> scales;
  for (size_t i = 0; i < count; ++i) {
    scales.push_back(random() % 8 == 0 ? 0.0f : 0.1f * static_cast<float>(1 + random() % 100));
  }
  return scales;
}

// Every mask's own scale, others between, one below and one above all of them.
std::vector<float> AskedScales(const std::vector<float>& mask_scales, std::mt19937_64& random) {
  std::vector<float> asked = mask_scales;
  for (int i = 0; i < 10; ++i) asked.push_back(0.011f * static_cast<float>(random() % 1000));
  asked.push_back(0.05f);
  asked.push_back(11);
  return asked;
}

// The paper's G from the masks' pixels.
struct PaperPairs {
  const std::vector<BinaryMask>& masks;
  const std::vector<float>& scales;

  bool Covers(size_t mask, size_t pixel) const {
    return scales[mask] > 0 && masks[mask].pixels[pixel] != 0;
  }
  // Lambda(s, p): the finest mask over p that is not smaller than s, of equal ones the first; or
  // -1.
  int Lambda(float s, size_t pixel) const {
    int best = -1;
    for (size_t mask = 0; mask < masks.size(); ++mask) {
      if (!Covers(mask, pixel) || scales[mask] < s) continue;
      if (best < 0 || scales[mask] < scales[best]) best = static_cast<int>(mask);
    }
    return best;
  }
  // "Lambda(s,p) = Lambda(s,q), or a shared finer mask"; an empty Lambda equals nothing.
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
  constexpr int kWidth = 12, kHeight = 9;
  std::mt19937_64 random(7);
  int together = 0, apart = 0;
  for (int trial = 0; trial < 24; ++trial) {
    // More than one word of masks in some trials.
    const auto masks = RandomMasks(kWidth, kHeight, trial % 4 == 0 ? 90 : 1 + trial / 2, random);
    const MaskSet set = BuildMaskSet(kWidth, kHeight, masks, /*duplicate_iou=*/1);
    ASSERT_EQ(set.num_masks, masks.size());
    const std::vector<float> scales = RandomScales(masks.size(), random);
    std::vector<int> pixels(20);
    for (int& pixel : pixels) pixel = static_cast<int>(random() % (kWidth * kHeight));
    for (const float s : AskedScales(scales, random)) {
      std::vector<std::vector<uint64_t>> labels;
      for (const int p : pixels) {
        labels.emplace_back(set.words);
        ScaleLabels(set.BitsAt(p % kWidth, p / kWidth), scales, s, labels.back());
      }
      for (size_t i = 0; i < pixels.size(); ++i) {
        for (size_t j = i; j < pixels.size(); ++j) {  // a pixel with itself, too
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

TEST(ScaleLabels, AboveTheLargestScaleKeepAllMasks) {
  const std::vector<uint64_t> bits = {0b1011};
  const std::vector<float> scales = {1, 2, 3, 0};
  std::vector<uint64_t> out(1);
  ScaleLabels(bits, scales, 9, out);
  EXPECT_EQ(out[0], 0b0011u);  // mask 2 is not there, mask 3 has no scale
  ScaleLabels(bits, scales, 0.5f, out);
  EXPECT_EQ(out[0], 0b0001u);
  ScaleLabels(bits, scales, 1.5f, out);
  EXPECT_EQ(out[0], 0b0011u);
}

}  // namespace
}  // namespace pepeseg
