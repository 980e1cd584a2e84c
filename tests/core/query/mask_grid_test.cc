#include "core/query/mask_grid.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <random>
#include <utility>
#include <vector>

#include "tests/testing/scale_maps.h"

namespace pepeseg {
namespace {

constexpr int kSide = 40;
using testing::Scales;
using Map = std::vector<float>;
const std::vector<float> kThresholds = testing::ScaleThresholds();

// A part inside an object inside a group: nested squares at the corner, less similar outwards. At
// small scales only the part is similar, at large scales all are.
Map Similarity(double scale) {
  Map map;
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      const int out = std::max(x, y);
      const bool part = out < 8, object = out < 16, group = out < 32;
      float value = group ? 0.15f : 0.1f;
      if (group && scale > 0.75) value = 0.95f;
      if (object) value = scale > 0.35 ? 0.96f : 0.2f;
      if (part) value = 0.97f;
      map.push_back(value);
    }
  }
  return map;
}

const Map kNothing(kSide* kSide, -1.0f);

TEST(MaskGrid, FindsPartObjectAndGroup) {
  Scales scales;
  for (int k = 0; k <= 10; ++k) scales.Add(Similarity(0.1 * k), kNothing);
  const MaskGrid grid = scales.Grid();
  const std::vector<Candidate> plateaus = grid.FindPlateaus(8, 3);
  ASSERT_EQ(plateaus.size(), 3u);
  // Scales 0 to 0.3 show the part, 0.4 to 0.7 the object, the rest the group.
  EXPECT_EQ(grid.Area(plateaus[0].cell), 64);
  EXPECT_EQ(grid.Area(plateaus[1].cell), 256);
  EXPECT_EQ(grid.Area(plateaus[2].cell), 1024);
  EXPECT_NEAR(plateaus[0].support, 4 / 11.0, 1e-9);
  EXPECT_NEAR(plateaus[2].support, 3 / 11.0, 1e-9);
  for (const Candidate& plateau : plateaus) EXPECT_EQ(plateau.stability, 1);
}

TEST(MaskGrid, GivesLittleSupportToAMaskThatChangesWithEveryStep) {
  Scales scales;
  std::mt19937 random(2);
  for (int k = 0; k < 6; ++k) {
    Map map = Similarity(0);
    for (float& value : map) {
      if (value < 0.5f) value = static_cast<float>(random() % 1000) / 1000;
    }
    scales.Add(k < 3 ? Similarity(0) : map, kNothing);
  }
  const MaskGrid grid = scales.Grid();
  const std::vector<Candidate> plateaus = grid.FindPlateaus(8, 10);
  ASSERT_GT(plateaus.size(), 1u);
  EXPECT_EQ(grid.Area(plateaus[0].cell), 64);
  EXPECT_GE(plateaus[0].support, 0.5);
  EXPECT_LT(plateaus[1].support, 0.1);
}

TEST(MaskGrid, IouMatchesTheMasks) {
  std::mt19937 random(5);
  std::vector<Map> maps;
  maps.reserve(3);
  Scales scales;
  for (int i = 0; i < 3; ++i) {
    Map positive, negative;
    for (int p = 0; p < 500; ++p) {
      positive.push_back(static_cast<float>(random() % 1000) / 1000);
      negative.push_back(static_cast<float>(random() % 1000) / 1000);
    }
    scales.Add(positive, negative);
    for (int p = 0; p < 500; ++p) {
      if (positive[p] <= negative[p]) positive[p] = -1;
    }
    maps.push_back(positive);
  }
  const MaskGrid grid = scales.Grid();
  for (int a = 0; a < 15; ++a) {
    for (int b = 0; b < 15; ++b) {
      int both = 0, either = 0;
      for (int p = 0; p < 500; ++p) {
        const bool in_a = maps[a / 5][p] > kThresholds[a % 5];
        const bool in_b = maps[b / 5][p] > kThresholds[b % 5];
        both += in_a && in_b ? 1 : 0;
        either += in_a || in_b ? 1 : 0;
      }
      EXPECT_NEAR(grid.Iou({a / 5, a % 5}, {b / 5, b % 5}), double(both) / either, 1e-12);
    }
  }
}

TEST(MaskGrid, HasNoPlateauWithoutAMask) {
  Scales scales;
  scales.Add(kNothing, kNothing);
  scales.Add(Map(kSide * kSide, 0.3f), kNothing);
  EXPECT_TRUE(scales.Grid().FindPlateaus(1, 3).empty());
  EXPECT_TRUE(Scales().Grid().FindPlateaus(1, 3).empty());
}

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

// Returns the candidates with the plateau that has the most support.
Candidates CandidatesOf(const MaskGrid& grid, int64_t min_area, int max_count) {
  return FindCandidates(grid, grid.FindPlateaus(min_area, kAll), 0, max_count);
}

GridCell CellOf(const Candidate& candidate) {
  const auto at =
      std::find(kThresholds.begin(), kThresholds.end(), static_cast<float>(candidate.threshold));
  return {static_cast<int>(candidate.scale), static_cast<int>(at - kThresholds.begin())};
}

std::vector<int64_t> Areas(const MaskGrid& grid, const Candidates& candidates) {
  std::vector<int64_t> areas;
  for (const Candidate& candidate : candidates.list) areas.push_back(grid.Area(CellOf(candidate)));
  return areas;
}

TEST(Candidates, ListsPartObjectAndGroupSmallestFirst) {
  testing::Scales scales;
  for (int k = 0; k < 3; ++k) scales.Add(Squares({{8, 0.95f}}), kNothing);
  for (int k = 0; k < 5; ++k) scales.Add(Squares({{16, 0.95f}}), kNothing);
  for (int k = 0; k < 2; ++k) scales.Add(Squares({{32, 0.95f}}), kNothing);
  const MaskGrid grid = scales.Grid();
  const Candidates found = CandidatesOf(grid, 8, 5);
  EXPECT_EQ(Areas(grid, found), (std::vector<int64_t>{64, 256, 1024}));
  EXPECT_EQ(found.best, 1);
  EXPECT_NEAR(found.list[1].support, 0.5, 1e-9);
}

// The part is most stable at large scales, the object is shown at all of them.
TEST(Candidates, ChoosesCellsWhoseScalesDoNotDecrease) {
  testing::Scales scales;
  for (int k = 0; k < 3; ++k) scales.Add(Squares({{8, 0.85f}, {16, 0.75f}}), kNothing);
  for (int k = 0; k < 7; ++k) scales.Add(Squares({{8, 0.95f}, {16, 0.65f}}), kNothing);
  const MaskGrid grid = scales.Grid();
  const std::vector<Candidate> plateaus = grid.FindPlateaus(8, 5);
  ASSERT_EQ(plateaus.size(), 2u);
  const Candidates found = CandidatesOf(grid, 8, 5);
  ASSERT_EQ(Areas(grid, found), (std::vector<int64_t>{64, 256}));
  EXPECT_LE(found.list[0].scale, found.list[1].scale);
  EXPECT_GT(found.list[0].threshold, found.list[1].threshold);
}

TEST(Candidates, ContainsTheRequiredPlateau) {
  testing::Scales scales;
  Map next_to = kNothing;
  for (int y = 20; y < 40; ++y) std::fill_n(next_to.begin() + y * kSide + 20, 20, 0.95f);
  for (int k = 0; k < 5; ++k) scales.Add(Squares({{16, 0.95f}}), kNothing);
  for (int k = 0; k < 2; ++k) scales.Add(next_to, kNothing);
  const MaskGrid grid = scales.Grid();
  const std::vector<Candidate> plateaus = grid.FindPlateaus(8, kAll);
  ASSERT_EQ(plateaus.size(), 2u);
  const Candidates found = FindCandidates(grid, plateaus, 1, 5);
  EXPECT_EQ(Areas(grid, found), (std::vector<int64_t>{400}));
  EXPECT_EQ(found.best, 0);
}

TEST(Candidates, LeavesOutAPartShownOnlyAtLargerScales) {
  testing::Scales scales;
  for (int k = 0; k < 6; ++k) scales.Add(Squares({{16, 0.95f}}), kNothing);
  for (int k = 0; k < 4; ++k) scales.Add(Squares({{8, 0.95f}}), kNothing);
  const MaskGrid grid = scales.Grid();
  const Candidates found = CandidatesOf(grid, 8, 5);
  EXPECT_EQ(Areas(grid, found), (std::vector<int64_t>{256}));
  EXPECT_EQ(found.best, 0);
}

TEST(Candidates, LeavesOutMasksThatGrowTooLittleOrDoNotNest) {
  testing::Scales scales;
  Map next_to = kNothing;
  for (int y = 20; y < 40; ++y) std::fill_n(next_to.begin() + y * kSide + 20, 20, 0.95f);
  for (int k = 0; k < 5; ++k) scales.Add(Squares({{16, 0.95f}}), kNothing);
  for (int k = 0; k < 3; ++k) scales.Add(Squares({{19, 0.95f}}), kNothing);  // 1.41 times
  for (int k = 0; k < 3; ++k) scales.Add(next_to, kNothing);
  const MaskGrid grid = scales.Grid();
  ASSERT_EQ(grid.FindPlateaus(8, 5).size(), 3u);
  EXPECT_EQ(Areas(grid, CandidatesOf(grid, 8, 5)), (std::vector<int64_t>{256}));
}

TEST(Candidates, KeepsTheBestAndThoseWithTheMostSupport) {
  testing::Scales scales;
  for (int k = 0; k < 2; ++k) scales.Add(Squares({{8, 0.95f}}), kNothing);
  for (int k = 0; k < 3; ++k) scales.Add(Squares({{16, 0.95f}}), kNothing);
  for (int k = 0; k < 5; ++k) scales.Add(Squares({{32, 0.95f}}), kNothing);
  const MaskGrid grid = scales.Grid();
  const Candidates two = CandidatesOf(grid, 8, 2);
  EXPECT_EQ(Areas(grid, two), (std::vector<int64_t>{256, 1024}));
  EXPECT_EQ(two.best, 1);
  const Candidates one = CandidatesOf(grid, 8, 1);
  EXPECT_EQ(Areas(grid, one), (std::vector<int64_t>{1024}));
  EXPECT_EQ(one.best, 0);
}

// Holds for random similarity maps.
TEST(Candidates, EachHoldsTheOneBefore) {
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
    const Candidates found = CandidatesOf(grid, 16, 16);
    const std::vector<Candidate> plateaus = grid.FindPlateaus(16, 1);
    ASSERT_EQ(found.list.empty(), plateaus.empty());
    if (plateaus.empty()) continue;
    EXPECT_EQ(found.list[found.best].support, plateaus[0].support);
    EXPECT_GE(grid.Iou(CellOf(found.list[found.best]), plateaus[0].cell), 0.9999);
    for (size_t i = 1; i < found.list.size(); ++i) {
      const GridCell small = CellOf(found.list[i - 1]), large = CellOf(found.list[i]);
      EXPECT_LE(small.scale, large.scale);
      EXPECT_GE(grid.Area(large), 1.5 * grid.Area(small));
      EXPECT_GE(grid.Common(small, large), 0.95 * grid.Area(small));
    }
  }
}

TEST(Candidates, IsEmptyWithoutAMask) {
  testing::Scales scales;
  scales.Add(kNothing, kNothing);
  EXPECT_TRUE(CandidatesOf(scales.Grid(), 1, 3).list.empty());
}

}  // namespace
}  // namespace pepeseg
