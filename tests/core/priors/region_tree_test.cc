#include "core/priors/region_tree.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

namespace pepeseg {
namespace {

constexpr int kImageWidth = 30, kImageHeight = 20;

// Two halves of different colour with a strong boundary between them, and a weaker ring around the
// middle of the left half.
PixelFeatures TwoHalves(std::vector<float>& strength) {
  strength.assign(kImageWidth * kImageHeight, 0.01f);
  std::vector<float> bin(kImageWidth * kImageHeight), other(kImageWidth * kImageHeight);
  for (int y = 0; y < kImageHeight; ++y) {
    for (int x = 0; x < kImageWidth; ++x) {
      float& at = strength[y * kImageWidth + x];
      if (x == 15) at = 0.9f;
      const bool ring = x >= 4 && x <= 10 && y >= 5 && y <= 14;
      const bool inside = x >= 5 && x <= 9 && y >= 6 && y <= 13;
      if (ring && !inside) at = 0.4f;
      bin[y * kImageWidth + x] = x < 15 ? 1.0f : 0.0f;
      other[y * kImageWidth + x] = x < 15 ? 0.0f : 1.0f;
    }
  }
  return {kImageWidth, kImageHeight, strength, 0.1f, {bin, other}, {1, 1}};
}

std::vector<std::vector<uint32_t>> LeafPixels(const RegionTree& tree) {
  std::vector<std::vector<uint32_t>> pixels(tree.num_leaves);
  for (uint32_t i = 0; i < tree.pixel_leaf.size(); ++i) pixels[tree.pixel_leaf[i]].push_back(i);
  return pixels;
}

TEST(RegionTree, MakesEachNodeTheUnionOfItsChildren) {
  std::vector<float> strength;
  const RegionTree tree = BuildRegionTree(TwoHalves(strength));
  ASSERT_GT(tree.num_leaves, 2);
  ASSERT_EQ(tree.nodes.size(), 2u * tree.num_leaves - 1);
  const auto leaves = LeafPixels(tree);
  for (size_t i = 0; i < tree.nodes.size(); ++i) {
    const RegionTree::Node& node = tree.nodes[i];
    EXPECT_EQ(PixelsOf(tree, static_cast<int32_t>(i), leaves).size(), size_t(node.area));
    EXPECT_EQ(node.parent < 0, i + 1 == tree.nodes.size());
    if (i < size_t(tree.num_leaves)) continue;
    int64_t area = 0;
    for (const int32_t child : node.children) {
      EXPECT_EQ(tree.nodes[child].parent, int32_t(i));
      EXPECT_LE(tree.nodes[child].height, node.height);
      area += tree.nodes[child].area;
    }
    EXPECT_EQ(area, node.area);
  }
  EXPECT_EQ(tree.nodes.back().area, kImageWidth * kImageHeight);
}

TEST(RegionTree, MergesAcrossTheStrongestBoundaryLast) {
  std::vector<float> strength;
  const RegionTree tree = BuildRegionTree(TwoHalves(strength));
  const auto leaves = LeafPixels(tree);
  const RegionTree::Node& root = tree.nodes.back();
  for (const int32_t child : root.children) {
    std::set<bool> halves;  // pixels of the boundary may belong to either half
    for (const uint32_t pixel : PixelsOf(tree, child, leaves)) {
      const int x = static_cast<int>(pixel) % kImageWidth;
      if (x != 15) halves.insert(x < 15);
    }
    EXPECT_EQ(halves.size(), 1u);
    EXPECT_LT(tree.nodes[child].weak, 0.05f);
    EXPECT_GT(tree.nodes[child].contrast, 0.8f);
  }
}

TEST(RegionTree, HasOneRegionWithoutBoundaries) {
  const std::vector<float> strength(kImageWidth * kImageHeight, 0.0f);
  const RegionTree tree = BuildRegionTree(
      {kImageWidth, kImageHeight, strength, 0, {std::vector<float>(strength.size(), 1)}, {1}});
  EXPECT_EQ(tree.num_leaves, 1);
  ASSERT_EQ(tree.nodes.size(), 1u);
  EXPECT_EQ(tree.nodes[0].area, kImageWidth * kImageHeight);
}

}  // namespace
}  // namespace pepeseg
