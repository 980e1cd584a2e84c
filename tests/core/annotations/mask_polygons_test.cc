#include "core/annotations/mask_polygons.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "tests/core/annotations/filled_polygons.h"

namespace pepeseg {
namespace {

// Returns the mask of lines of '#' and '.'.
std::vector<uint8_t> MaskOf(const std::vector<std::string>& lines) {
  std::vector<uint8_t> mask;
  for (const std::string& line : lines) {
    for (const char c : line) mask.push_back(c == '#' ? 1 : 0);
  }
  return mask;
}

RasterSize SizeOf(const std::vector<std::string>& lines) {
  return {static_cast<int>(lines[0].size()), static_cast<int>(lines.size())};
}

const std::vector<std::vector<std::string>> kMasks = {
    {"#"},
    {"...", ".#.", "..."},
    {"##.", ".##", "#.#"},  // pixels that touch by a corner
    {"#####", "#...#", "#.#.#", "#...#", "#####"},
    {"#######", "#.#.#.#", "#######", "#..#..#", "#######"},
    {"######", "#.####", "##.###", "######"},  // holes that touch by a corner
    {"#.#.#", ".#.#.", "#.#.#"},
};

TEST(MaskPolygons, GiveTheMaskAgain) {
  for (const auto& lines : kMasks) {
    const RasterSize size = SizeOf(lines);
    EXPECT_EQ(Filled(PolygonsOf(MaskOf(lines), size), size), MaskOf(lines)) << lines[0];
    EXPECT_EQ(Filled({Joined(PolygonsOf(MaskOf(lines), size))}, size), MaskOf(lines)) << lines[0];
  }
}

TEST(MaskPolygons, GiveRandomMasksAgain) {
  std::mt19937 random(7);
  for (int repeat = 0; repeat < 50; ++repeat) {
    const RasterSize size{17, 13};
    std::vector<uint8_t> mask(static_cast<size_t>(size.width) * size.height);
    for (uint8_t& pixel : mask) pixel = random() % 5 < 3 ? 1 : 0;
    EXPECT_EQ(Filled(PolygonsOf(mask, size), size), mask);
    EXPECT_EQ(Filled({Joined(PolygonsOf(mask, size))}, size), mask);
  }
}

TEST(MaskPolygons, HaveVerticesThatTruncateToPixelsOfTheMask) {
  const std::vector<std::string> square = {"....", ".##.", ".##.", "...."};
  for (const Polygon& polygon : PolygonsOf(MaskOf(square), SizeOf(square))) {
    for (const PolygonPoint& point : polygon) {
      EXPECT_EQ(square[static_cast<size_t>(point.y)][static_cast<size_t>(point.x)], '#');
    }
  }
}

TEST(MaskPolygons, AreOneForEachPart) {
  const std::vector<std::string> parts = {"##..#", "##..#", ".....", "#...#"};
  EXPECT_EQ(PolygonsOf(MaskOf(parts), SizeOf(parts)).size(), 4U);
  EXPECT_TRUE(PolygonsOf(MaskOf({"..."}), {3, 1}).empty());
  EXPECT_TRUE(Joined({}).empty());
}

}  // namespace
}  // namespace pepeseg
