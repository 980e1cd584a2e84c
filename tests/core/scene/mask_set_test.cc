#include "core/scene/mask_set.h"

#include <gtest/gtest.h>

#include <map>
#include <random>
#include <set>

namespace pepeseg {
namespace {

constexpr int kWidth = 20;
constexpr int kHeight = 12;

BinaryMask Box(int left, int top, int right, int bottom) {
  BinaryMask mask;
  mask.pixels.assign(kWidth * kHeight, 0);
  for (int y = top; y < bottom; ++y) {
    for (int x = left; x < right; ++x) mask.pixels[y * kWidth + x] = 1;
  }
  return mask;
}

std::vector<BinaryMask> RandomBoxes(int count) {
  std::mt19937 random(7);
  const auto draw = [&random](int most) { return static_cast<int>(random() % most); };
  std::vector<BinaryMask> masks;
  for (int i = 0; i < count; ++i) {
    const int left = draw(kWidth), top = draw(kHeight);
    masks.push_back(Box(left, top, left + 1 + draw(kWidth - left), top + 1 + draw(kHeight - top)));
  }
  return masks;
}

// Checks that pixels share a mask cell exactly if the same masks cover them, and that every cell
// but cell 0 has pixels.
void ExpectConsistent(const MaskSet& set) {
  std::map<uint32_t, std::set<int>> masks_of_patch;
  std::map<std::set<int>, uint32_t> patch_of_masks;
  for (int y = 0; y < set.height; ++y) {
    for (int x = 0; x < set.width; ++x) {
      std::set<int> covering;
      for (int mask = 0; mask < set.num_masks; ++mask) {
        if (set.Covers(mask, x, y)) covering.insert(mask);
      }
      const uint32_t cell = set.pixel_cell[static_cast<size_t>(y) * set.width + x];
      EXPECT_EQ(masks_of_patch.try_emplace(cell, covering).first->second, covering);
      EXPECT_EQ(patch_of_masks.try_emplace(covering, cell).first->second, cell);
      EXPECT_EQ(cell == 0, covering.empty());
    }
  }
  const int unused = masks_of_patch.contains(0) ? 0 : 1;
  EXPECT_EQ(set.num_cells(), static_cast<int>(masks_of_patch.size()) + unused);
}

TEST(MaskSet, ReturnsTheMasksItWasBuiltFrom) {
  const std::vector<BinaryMask> masks = {Box(0, 0, 10, 10), Box(5, 5, 15, 12), Box(6, 6, 8, 8)};
  const MaskSet set = BuildMaskSet(kWidth, kHeight, masks);
  ASSERT_EQ(set.num_masks, 3);
  EXPECT_EQ(set.num_cells(), 5);  // no mask; first; first and second; all three; second
  EXPECT_EQ(set.mask_area, (std::vector<int64_t>{100, 70, 4}));
  for (int mask = 0; mask < 3; ++mask) EXPECT_EQ(set.Extract(mask).pixels, masks[mask].pixels);
  ExpectConsistent(set);
}

TEST(MaskSet, HoldsMoreMasksThanBitsInAWord) {
  const std::vector<BinaryMask> masks = RandomBoxes(150);
  const MaskSet set = BuildMaskSet(kWidth, kHeight, masks, /*duplicate_iou=*/1.0);
  ASSERT_EQ(set.num_masks, 150);
  ASSERT_EQ(set.words, 3);
  for (int mask = 0; mask < 150; ++mask) EXPECT_EQ(set.Extract(mask).pixels, masks[mask].pixels);
  ExpectConsistent(set);
}

TEST(MaskSet, DropsDuplicatesAndEmptyMasks) {
  const std::vector<BinaryMask> masks = {Box(0, 0, 10, 10), Box(3, 3, 3, 3), Box(0, 0, 10, 10),
                                         Box(0, 0, 10, 9), Box(0, 0, 20, 12)};
  EXPECT_EQ(BuildMaskSet(kWidth, kHeight, masks, 0.95).mask_area,
            (std::vector<int64_t>{100, 90, 240}));
  EXPECT_EQ(BuildMaskSet(kWidth, kHeight, masks, 0.85).mask_area, (std::vector<int64_t>{100, 240}));
}

TEST(MaskSet, IsTheSameFromRuns) {
  const MaskSet set = BuildMaskSet(kWidth, kHeight, RandomBoxes(100));
  MaskSetBuilder builder(kWidth, kHeight);
  for (const std::vector<PixelRun>& runs : RunsOfMasks(set)) EXPECT_TRUE(builder.AddRuns(runs));
  EXPECT_FALSE(builder.AddRuns({}));
  const MaskSet again = std::move(builder).Build();
  EXPECT_EQ(again.mask_area, set.mask_area);
  EXPECT_EQ(again.pixel_cell, set.pixel_cell);
  EXPECT_EQ(again.cell_bits, set.cell_bits);
}

TEST(MaskSet, HasRunsWithoutIgnoredPixels) {
  const MaskSet set = BuildMaskSet(kWidth, kHeight, {{Box(0, 1, kWidth, 3), Box(4, 2, 8, 3)}});
  std::vector<uint8_t> ignore(kWidth * kHeight, 0);
  ignore[2 * kWidth + 6] = 1;
  const auto runs = RunsOfMasks(set, ignore);
  ASSERT_EQ(runs.size(), 2u);
  // The second box cuts the first one's pixels in cells, not its runs.
  EXPECT_EQ(runs[0],
            (std::vector<PixelRun>{{kWidth, 2 * kWidth + 6}, {2 * kWidth + 7, 3 * kWidth}}));
  EXPECT_EQ(runs[1], (std::vector<PixelRun>{{2 * kWidth + 4, 2 * kWidth + 6},
                                            {2 * kWidth + 7, 2 * kWidth + 8}}));
}

TEST(MaskSet, KeepsCellZeroWhenAMaskCoversEveryPixel) {
  const MaskSet set = BuildMaskSet(kWidth, kHeight, std::vector{Box(0, 0, kWidth, kHeight)});
  EXPECT_EQ(set.num_cells(), 2);
  EXPECT_EQ(set.BitsAt(3, 3)[0], 1u);
  ExpectConsistent(set);
}

TEST(MaskSet, IsEmptyWithoutMasks) {
  const MaskSet set = BuildMaskSet(kWidth, kHeight, {});
  EXPECT_TRUE(set.empty());
  EXPECT_TRUE(set.pixel_cell.empty());
  EXPECT_EQ(set.BitsAt(1, 1)[0], 0u);
}

TEST(ResampleMaskSet, TakesEachPixelFromItsSource) {
  const std::vector<BinaryMask> masks = RandomBoxes(30);
  const MaskSet set = BuildMaskSet(kWidth, kHeight, masks);
  std::vector<int32_t> source;  // every other pixel of the right half
  for (int y = 0; y < kHeight; y += 2) {
    for (int x = kWidth / 2; x < kWidth; x += 2) source.push_back(y * kWidth + x);
  }
  const MaskSet half = ResampleMaskSet(set, kWidth / 4, kHeight / 2, source);
  int shown = 0;
  for (int mask = 0; mask < set.num_masks; ++mask) {
    std::vector<uint8_t> expected;
    expected.reserve(source.size());
    for (const int32_t from : source) expected.push_back(set.Extract(mask).pixels[from]);
    if (std::find(expected.begin(), expected.end(), 1) == expected.end()) continue;
    ASSERT_LT(shown, half.num_masks);
    EXPECT_EQ(half.Extract(shown++).pixels, expected);
  }
  EXPECT_EQ(shown, half.num_masks);
  ExpectConsistent(half);
}

}  // namespace
}  // namespace pepeseg
