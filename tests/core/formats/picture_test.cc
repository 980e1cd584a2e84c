#include "core/formats/picture.h"

#include <gtest/gtest.h>

#include <array>
#include <string>

namespace pepeseg {
namespace {

// An image of one channel, 3 pixels wide and 2 high.
Image Letters(const std::string& text = "abcdef") {
  Image image{3, 2, 1, {}};
  image.pixels.assign(text.begin(), text.end());
  return image;
}

TEST(Upright, AppliesEachOrientation) {
  struct Case {
    int width;
    std::string pixels;
  };
  // Stored:  a b c
  //          d e f
  const std::array<Case, 8> cases = {{{3, "abcdef"},
                                      {3, "cbafed"},
                                      {3, "fedcba"},
                                      {3, "defabc"},
                                      {2, "adbecf"},
                                      {2, "daebfc"},
                                      {2, "fcebda"},
                                      {2, "cfbead"}}};
  for (int orientation = 1; orientation <= 8; ++orientation) {
    const Image turned = Upright(Letters(), orientation);
    const Case& expected = cases[static_cast<size_t>(orientation) - 1];
    EXPECT_EQ(turned.width, expected.width) << orientation;
    EXPECT_EQ(turned.height, 6 / expected.width) << orientation;
    EXPECT_EQ(std::string(turned.pixels.begin(), turned.pixels.end()), expected.pixels)
        << orientation;
  }
}

TEST(Upright, IgnoresUnknownOrientations) {
  for (const int orientation : {-1, 0, 9}) {
    EXPECT_EQ(Upright(Letters(), orientation).pixels, Letters().pixels);
  }
}

TEST(ShrunkTo, AveragesToTheLongerSide) {
  Image image{8, 4, 3, {}};
  image.pixels.assign(8 * 4 * 3, 100);
  for (size_t i = 0; i < image.pixels.size(); i += 6) image.pixels[i] = 200;  // every other red
  const Image half = ShrunkTo(image, 4);
  EXPECT_EQ(half.width, 4);
  EXPECT_EQ(half.height, 2);
  ASSERT_EQ(half.pixels.size(), 4u * 2 * 3);
  EXPECT_EQ(half.pixels[0], 150);
  EXPECT_EQ(half.pixels[1], 100);
}

TEST(ShrunkTo, NeverEnlarges) {
  EXPECT_EQ(ShrunkTo(Letters(), 0).width, 3);
  EXPECT_EQ(ShrunkTo(Letters(), 3).width, 3);
  EXPECT_EQ(ShrunkTo(Letters(), 900).width, 3);
  EXPECT_EQ(ShrunkTo(Letters(), 1).height, 1);
}

}  // namespace
}  // namespace pepeseg
