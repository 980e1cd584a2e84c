#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/formats/images.h"

namespace pepeseg {
namespace {

// A disc of radius 12 in 48x40 pixels: 0 outside, `inside` inside, a ramp of `width` pixels
// between.
LabelImage Disc(uint32_t inside, double width) {
  LabelImage image{48, 40, {}};
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const double depth = 12 - std::hypot(x - 24, y - 20);
      const double share = width > 0 ? std::clamp(depth / width + 0.5, 0.0, 1.0) : depth > 0;
      image.labels.push_back(static_cast<uint32_t>(std::lround(share * inside)));
    }
  }
  return image;
}

TEST(SoftMaskThreshold, IsHalfOfTheValueOfASoftMask) {
  EXPECT_EQ(SoftMaskThreshold(Disc(255, 2)), 127u);
  EXPECT_EQ(SoftMaskThreshold(Disc(255, 6)), 127u);
  EXPECT_EQ(SoftMaskThreshold(Disc(65535, 4)), 32767u);
}

TEST(SoftMaskThreshold, IsThatOfGreyInThreeChannels) {
  LabelImage image = Disc(255, 4);
  for (uint32_t& label : image.labels) label *= 0x10101;
  EXPECT_EQ(SoftMaskThreshold(image), 0xffffffu / 2);
}

TEST(SoftMaskThreshold, IsNoneForSharpMasksAndForLabels) {
  EXPECT_FALSE(SoftMaskThreshold(Disc(255, 0)));
  EXPECT_FALSE(SoftMaskThreshold(Disc(1, 0)));
  LabelImage labels = Disc(1, 0);  // three things, and a trimap
  for (size_t i = 0; i < labels.labels.size(); ++i) labels.labels[i] *= 1 + i % 48 / 20;
  EXPECT_FALSE(SoftMaskThreshold(labels));
  LabelImage trimap = Disc(255, 0);
  for (size_t i = 0; i < 48 * 8; ++i) trimap.labels[i] = 128;
  EXPECT_FALSE(SoftMaskThreshold(trimap));
  LabelImage colours = Disc(0xff0000, 0);
  EXPECT_FALSE(SoftMaskThreshold(colours));
}

TEST(ResizedLabels, TakeTheNearestPixel) {
  const LabelImage image{2, 1, {3, 5}};
  EXPECT_EQ(ResizedLabels(image, 4, 2).labels, (std::vector<uint32_t>{3, 3, 5, 5, 3, 3, 5, 5}));
  EXPECT_EQ(ResizedLabels({4, 2, {1, 1, 2, 2, 1, 1, 2, 2}}, 2, 1).labels,
            (std::vector<uint32_t>{1, 2}));
}

}  // namespace
}  // namespace pepeseg
