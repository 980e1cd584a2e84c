#include "core/features/random_draws.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "core/features/mask_scales.h"
#include "tests/testing/synthetic_capture.h"

namespace pepeseg {
namespace {

std::vector<int32_t> AllPixels(const MaskSet& masks) {
  std::vector<int32_t> pixels(masks.pixel_cell.size());
  std::iota(pixels.begin(), pixels.end(), 0);
  return pixels;
}

bool Covers(const MaskSet& masks, int mask, int32_t pixel) {
  return masks.Covers(mask, pixel % masks.width, pixel / masks.width);
}

class PixelsByMaskTest : public ::testing::Test {
 protected:
  PixelsByMaskTest() : capture_(testing::MakeSyntheticScene().capture) {
    for (const View& view : capture_.views) {
      if (masks_ == nullptr || view.masks.num_masks > masks_->num_masks) masks_ = &view.masks;
    }
    scales_.assign(masks_->num_masks, 1);
  }

  Capture capture_;
  const MaskSet* masks_ = nullptr;  // of the view with the most masks
  std::vector<float> scales_;
  std::mt19937_64 random_{1};
};

TEST_F(PixelsByMaskTest, DrawsOnlyPixelsUnderMasks) {
  const PixelsByMask by_mask(*masks_, scales_, AllPixels(*masks_));
  ASSERT_FALSE(by_mask.empty());
  for (int i = 0; i < 2000; ++i) EXPECT_NE(masks_->pixel_cell[by_mask.Draw(random_)], 0u);
}

// A pixel is expected with the probability 1 / (masks * area), summed over the masks that cover it.
TEST_F(PixelsByMaskTest, DrawsAllMasksEquallyOften) {
  ASSERT_GE(masks_->num_masks, 2);
  const PixelsByMask by_mask(*masks_, scales_, AllPixels(*masks_));
  constexpr int kDraws = 40'000;
  std::map<int32_t, int> times;
  for (int i = 0; i < kDraws; ++i) ++times[static_cast<int32_t>(by_mask.Draw(random_))];
  for (int mask = 0; mask < masks_->num_masks; ++mask) {
    double expected = 0, drawn = 0;
    for (const int32_t pixel : AllPixels(*masks_)) {
      if (!Covers(*masks_, mask, pixel)) continue;
      for (int other = 0; other < masks_->num_masks; ++other) {
        if (!Covers(*masks_, other, pixel)) continue;
        expected += 1.0 / masks_->num_masks / static_cast<double>(masks_->mask_area[other]);
      }
      const auto found = times.find(pixel);
      drawn += found == times.end() ? 0 : found->second;
    }
    EXPECT_NEAR(drawn / kDraws, expected, 5 * std::sqrt(expected / kDraws)) << "mask " << mask;
  }
}

TEST_F(PixelsByMaskTest, SkipsMasksWithoutAScale) {
  std::fill(scales_.begin() + 1, scales_.end(), kNoScale);
  const PixelsByMask by_mask(*masks_, scales_, AllPixels(*masks_));
  for (int i = 0; i < 500; ++i) {
    EXPECT_TRUE(Covers(*masks_, 0, static_cast<int32_t>(by_mask.Draw(random_))));
  }
}

TEST_F(PixelsByMaskTest, DrawsOnlyFromTheGivenPixels) {
  std::vector<int32_t> some = AllPixels(*masks_);
  std::erase_if(some, [&](int32_t pixel) { return pixel % 3 != 0; });
  const PixelsByMask by_mask(*masks_, scales_, some);
  for (int i = 0; i < 500; ++i) {
    const size_t place = by_mask.Draw(random_);
    ASSERT_LT(place, some.size());
    EXPECT_NE(masks_->pixel_cell[some[place]], 0u);
  }
  EXPECT_TRUE(PixelsByMask(*masks_, scales_, {}).empty());
}

}  // namespace
}  // namespace pepeseg
