#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <random>
#include <vector>

#include "core/prompt/mask_grid.h"
#include "tests/testing/scale_maps.h"

namespace pepeseg {
namespace {

constexpr int kSide = 40;
using Map = std::vector<float>;
const Map kNothing(kSide* kSide, -1.0f);

// Returns similarities of nested squares at the corner, given as (side, similarity), smallest
// first.
struct Square {
  int side;
  float similarity;
};
Map Squares(const std::vector<Square>& squares) {
  Map map(kSide * kSide, 0.0f);
  for (auto square = squares.rbegin(); square != squares.rend(); ++square) {
    for (int y = 0; y < square->side; ++y) {
      std::fill_n(map.begin() + y * kSide, square->side, square->similarity);
    }
  }
  return map;
}

constexpr int kAll = std::numeric_limits<int>::max();

// Returns the ladder through the plateau with the most support.
Ladder LadderOf(const MaskGrid& grid, int64_t min_area, int max_count) {
  return FindLadder(grid, grid.FindPlateaus(min_area, kAll), 0, max_count);
}

std::vector<int64_t> Areas(const MaskGrid& grid, const Ladder& ladder) {
  std::vector<int64_t> areas;
  for (const auto& rung : ladder.rungs) areas.push_back(grid.Area(rung.cell));
  return areas;
}

TEST(Ladder, ListsPartObjectAndGroupSmallestFirst) {
  testing::Scales scales;
  for (int k = 0; k < 3; ++k) scales.Add(Squares({{8, 0.95f}}), kNothing);
  for (int k = 0; k < 5; ++k) scales.Add(Squares({{16, 0.95f}}), kNothing);
  for (int k = 0; k < 2; ++k) scales.Add(Squares({{32, 0.95f}}), kNothing);
  const MaskGrid grid = scales.Grid();
  const Ladder ladder = LadderOf(grid, 8, 5);
  EXPECT_EQ(Areas(grid, ladder), (std::vector<int64_t>{64, 256, 1024}));
  EXPECT_EQ(ladder.best, 1);
  EXPECT_NEAR(ladder.rungs[1].support, 0.5, 1e-9);
}

// The part is most stable at large scales, the object is shown at all of them.
TEST(Ladder, ChoosesCellsWhoseScalesDoNotDecrease) {
  testing::Scales scales;
  for (int k = 0; k < 3; ++k) scales.Add(Squares({{8, 0.85f}, {16, 0.75f}}), kNothing);
  for (int k = 0; k < 7; ++k) scales.Add(Squares({{8, 0.95f}, {16, 0.65f}}), kNothing);
  const MaskGrid grid = scales.Grid();
  const std::vector<MaskGrid::Plateau> plateaus = grid.FindPlateaus(8, 5);
  ASSERT_EQ(plateaus.size(), 2u);
  const Ladder ladder = LadderOf(grid, 8, 5);
  ASSERT_EQ(Areas(grid, ladder), (std::vector<int64_t>{64, 256}));
  EXPECT_LE(ladder.rungs[0].cell.scale, ladder.rungs[1].cell.scale);
  EXPECT_GT(ladder.rungs[0].cell.threshold, ladder.rungs[1].cell.threshold);
}

TEST(Ladder, ContainsTheRequiredPlateau) {
  testing::Scales scales;
  Map beside = kNothing;
  for (int y = 20; y < 40; ++y) std::fill_n(beside.begin() + y * kSide + 20, 20, 0.95f);
  for (int k = 0; k < 5; ++k) scales.Add(Squares({{16, 0.95f}}), kNothing);
  for (int k = 0; k < 2; ++k) scales.Add(beside, kNothing);
  const MaskGrid grid = scales.Grid();
  const std::vector<MaskGrid::Plateau> plateaus = grid.FindPlateaus(8, kAll);
  ASSERT_EQ(plateaus.size(), 2u);
  const Ladder ladder = FindLadder(grid, plateaus, 1, 5);
  EXPECT_EQ(Areas(grid, ladder), (std::vector<int64_t>{400}));
  EXPECT_EQ(ladder.best, 0);
}

TEST(Ladder, LeavesOutAPartShownOnlyAtLargerScales) {
  testing::Scales scales;
  for (int k = 0; k < 6; ++k) scales.Add(Squares({{16, 0.95f}}), kNothing);
  for (int k = 0; k < 4; ++k) scales.Add(Squares({{8, 0.95f}}), kNothing);
  const MaskGrid grid = scales.Grid();
  const Ladder ladder = LadderOf(grid, 8, 5);
  EXPECT_EQ(Areas(grid, ladder), (std::vector<int64_t>{256}));
  EXPECT_EQ(ladder.best, 0);
}

TEST(Ladder, LeavesOutMasksThatGrowTooLittleOrDoNotNest) {
  testing::Scales scales;
  Map beside = kNothing;
  for (int y = 20; y < 40; ++y) std::fill_n(beside.begin() + y * kSide + 20, 20, 0.95f);
  for (int k = 0; k < 5; ++k) scales.Add(Squares({{16, 0.95f}}), kNothing);
  for (int k = 0; k < 3; ++k) scales.Add(Squares({{19, 0.95f}}), kNothing);  // 1.41 times
  for (int k = 0; k < 3; ++k) scales.Add(beside, kNothing);
  const MaskGrid grid = scales.Grid();
  ASSERT_EQ(grid.FindPlateaus(8, 5).size(), 3u);
  EXPECT_EQ(Areas(grid, LadderOf(grid, 8, 5)), (std::vector<int64_t>{256}));
}

TEST(Ladder, KeepsTheBestAndThoseWithTheMostSupport) {
  testing::Scales scales;
  for (int k = 0; k < 2; ++k) scales.Add(Squares({{8, 0.95f}}), kNothing);
  for (int k = 0; k < 3; ++k) scales.Add(Squares({{16, 0.95f}}), kNothing);
  for (int k = 0; k < 5; ++k) scales.Add(Squares({{32, 0.95f}}), kNothing);
  const MaskGrid grid = scales.Grid();
  const Ladder two = LadderOf(grid, 8, 2);
  EXPECT_EQ(Areas(grid, two), (std::vector<int64_t>{256, 1024}));
  EXPECT_EQ(two.best, 1);
  const Ladder one = LadderOf(grid, 8, 1);
  EXPECT_EQ(Areas(grid, one), (std::vector<int64_t>{1024}));
  EXPECT_EQ(one.best, 0);
}

// Holds for random similarity maps.
TEST(Ladder, EachRungHoldsTheOneBefore) {
  std::mt19937 random(11);
  for (int round = 0; round < 200; ++round) {
    testing::Scales scales;
    for (int k = 0; k < 6; ++k) {
      std::vector<Square> squares;
      for (int side = 4; side < kSide; side += 4) {
        squares.push_back({side, static_cast<float>(random() % 1000) / 1000});
      }
      scales.Add(Squares(squares), kNothing);
    }
    const MaskGrid grid = scales.Grid();
    const Ladder ladder = LadderOf(grid, 16, 16);
    const std::vector<MaskGrid::Plateau> plateaus = grid.FindPlateaus(16, 1);
    ASSERT_EQ(ladder.rungs.empty(), plateaus.empty());
    if (plateaus.empty()) continue;
    EXPECT_EQ(ladder.rungs[ladder.best].support, plateaus[0].support);
    EXPECT_GE(grid.Iou(ladder.rungs[ladder.best].cell, plateaus[0].cell), 0.9999);
    for (size_t i = 1; i < ladder.rungs.size(); ++i) {
      const MaskGrid::Cell small = ladder.rungs[i - 1].cell, large = ladder.rungs[i].cell;
      EXPECT_LE(small.scale, large.scale);
      EXPECT_GE(grid.Area(large), 1.5 * grid.Area(small));
      EXPECT_GE(grid.Common(small, large), 0.95 * grid.Area(small));
    }
  }
}

TEST(Ladder, IsEmptyWithoutAMask) {
  testing::Scales scales;
  scales.Add(kNothing, kNothing);
  EXPECT_TRUE(LadderOf(scales.Grid(), 1, 3).rungs.empty());
}

}  // namespace
}  // namespace pepeseg
