#include "core/prompt/mask_grid.h"

#include <gtest/gtest.h>

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
  const std::vector<MaskGrid::Plateau> plateaus = grid.FindPlateaus(8, 3);
  ASSERT_EQ(plateaus.size(), 3u);
  // Scales 0 to 0.3 show the part, 0.4 to 0.7 the object, the rest the group.
  EXPECT_EQ(grid.Area(plateaus[0].cell), 64);
  EXPECT_EQ(grid.Area(plateaus[1].cell), 256);
  EXPECT_EQ(grid.Area(plateaus[2].cell), 1024);
  EXPECT_NEAR(plateaus[0].support, 4 / 11.0, 1e-9);
  EXPECT_NEAR(plateaus[2].support, 3 / 11.0, 1e-9);
  for (const MaskGrid::Plateau& plateau : plateaus) EXPECT_EQ(plateau.stability, 1);
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
  const std::vector<MaskGrid::Plateau> plateaus = grid.FindPlateaus(8, 10);
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

}  // namespace
}  // namespace pepeseg
