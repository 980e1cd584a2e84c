#include "core/features/scale_labels.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

namespace pepeseg {
namespace {

// Random overlapping rectangles.
MaskSet RandomMasks(int width, int height, int count, std::mt19937_64& random) {
  std::vector<BinaryMask> masks;
  for (int i = 0; i < count; ++i) {
    const int x0 = static_cast<int>(random() % width), y0 = static_cast<int>(random() % height);
    const int x1 = x0 + 1 + static_cast<int>(random() % width);
    const int y1 = y0 + 1 + static_cast<int>(random() % height);
    BinaryMask mask;
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        mask.pixels.push_back(x >= x0 && x < x1 && y >= y0 && y < y1);
      }
    }
    masks.push_back(mask);
  }
  return BuildMaskSet(width, height, masks);
}

struct Covered {
  const MaskSet& masks;
  const std::vector<float>& scales;
  int x, y;

  bool By(int mask) const { return scales[mask] > 0 && masks.Covers(mask, x, y); }
  // The paper's Lambda(s, p): the finest mask over p that is not smaller than s, or -1.
  int Lambda(float s) const {
    int best = -1;
    for (int mask = 0; mask < masks.num_masks; ++mask) {
      if (!By(mask) || scales[mask] < s) continue;
      if (best < 0 || scales[mask] < scales[best]) best = mask;
    }
    return best;
  }
};

// "Lambda(s,p) = Lambda(s,q), or a shared finer mask"; an empty Lambda equals nothing.
bool Together(const Covered& p, const Covered& q, float s) {
  if (p.Lambda(s) >= 0 && p.Lambda(s) == q.Lambda(s)) return true;
  for (int mask = 0; mask < p.masks.num_masks; ++mask) {
    if (p.scales[mask] < s && p.By(mask) && q.By(mask)) return true;
  }
  return false;
}

TEST(ScaleLabels, IntersectAsThePaperPairsPixels) {
  std::mt19937_64 random(7);
  int together = 0, apart = 0;
  for (int trial = 0; trial < 40; ++trial) {
    const int width = 12, height = 9;
    // More than one word of masks in some trials.
    const MaskSet masks = RandomMasks(width, height, trial % 4 == 0 ? 90 : 12, random);
    std::vector<float> scales;
    scales.reserve(masks.num_masks);
    for (int i = 0; i < masks.num_masks; ++i) {
      scales.push_back(random() % 8 == 0 ? 0.0f : 0.01f * static_cast<float>(1 + random() % 1000));
    }
    for (int draw = 0; draw < 200; ++draw) {
      const Covered p = {masks, scales, int(random() % width), int(random() % height)};
      const Covered q = {masks, scales, int(random() % width), int(random() % height)};
      const float s = draw % 5 == 0 && masks.num_masks > 0
                          ? scales[random() % scales.size()]  // exactly a mask's own
                          : 0.011f * static_cast<float>(random() % 1000);
      std::vector<uint64_t> a(masks.words), b(masks.words);
      ScaleLabels(masks.BitsAt(p.x, p.y), scales, s, a);
      ScaleLabels(masks.BitsAt(q.x, q.y), scales, s, b);
      uint64_t common = 0;
      for (int word = 0; word < masks.words; ++word) common |= a[word] & b[word];
      const bool want = Together(p, q, s);
      ASSERT_EQ(common != 0, want) << "scale " << s;
      ++(want ? together : apart);
    }
  }
  EXPECT_GT(together, 500);
  EXPECT_GT(apart, 500);
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
