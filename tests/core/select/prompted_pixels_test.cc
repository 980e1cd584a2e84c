#include "core/select/prompted_pixels.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace pepeseg {
namespace {

Prompt In10x8() {
  Prompt prompt;
  prompt.view.camera = {10, 8, 10, 10, 5, 4};
  return prompt;
}

TEST(PromptedPixels, OfPointsAreThoseAroundPositiveOnes) {
  Prompt prompt = In10x8();
  prompt.what = std::vector<PointPrompt>{{0.5, 0.5, true}, {8.5, 6.5, false}};
  EXPECT_EQ(PromptedPixels(prompt, 100), (std::vector<int32_t>{0, 1, 2, 10, 11, 20}));
}

TEST(PromptedPixels, OfABoxHaveTheirCentresInIt) {
  Prompt prompt = In10x8();
  prompt.what = BoxPrompt{-3, 1.4, 4.6, 1.2};  // to (1.6, 2.6)
  EXPECT_EQ(PromptedPixels(prompt, 100), (std::vector<int32_t>{10, 11, 20, 21}));
}

TEST(PromptedPixels, OfAMaskAreItsOwnEvenlyThinnedOut) {
  Prompt prompt = In10x8();
  BinaryMask mask = {std::vector<uint8_t>(80)};
  mask.pixels[7] = mask.pixels[79] = 1;
  prompt.what = mask;
  EXPECT_EQ(PromptedPixels(prompt, 100), (std::vector<int32_t>{7, 79}));
  std::fill(mask.pixels.begin(), mask.pixels.end(), 1);
  prompt.what = mask;
  EXPECT_EQ(PromptedPixels(prompt, 4), (std::vector<int32_t>{10, 30, 50, 70}));
}

}  // namespace
}  // namespace pepeseg
