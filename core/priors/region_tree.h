#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace pepeseg {

// A hierarchy of regions of an image. The leaves are small regions that partition the image; each
// other node is the union of its two children (after Arbelaez et al., "Contour Detection and
// Hierarchical Image Segmentation", 2011).
struct RegionTree {
  struct Node {
    int32_t parent = -1;             // -1: the root
    int32_t children[2] = {-1, -1};  // -1: a leaf
    int64_t area = 0;                // pixels
    // Dissimilarity at which the children were merged, at least theirs. 0: a leaf.
    float height = 0;
    float contrast = 0;  // mean boundary strength along its border, without the image's rim
    float weak = 0;      // share of that border with a strength below PixelFeatures::weak
  };
  std::vector<Node> nodes;          // leaves first, children before parents, the root last
  std::vector<int32_t> pixel_leaf;  // [height * width] the leaf of each pixel
  int num_leaves = 0;
};

// Features of each pixel by which regions are formed and compared.
struct PixelFeatures {
  int width = 0, height = 0;
  std::span<const float> strength;       // [height, width] boundary strength, in [0, 1]
  float weak = 0;                        // strength below which a boundary is weak
  std::vector<std::vector<float>> bins;  // [bins][height * width] soft histograms
  std::vector<float> bin_weights;        // [bins] weights in the chi-squared distance
};

// Builds the tree of an image with at least one pixel. Equal inputs give equal trees.
RegionTree BuildRegionTree(const PixelFeatures& pixels);

// Returns the pixels of a node: those of its leaves, one leaf after the other. leaf_pixels: the
// pixels of each leaf, [num_leaves].
std::vector<uint32_t> PixelsOf(const RegionTree& tree, int32_t node,
                               std::span<const std::vector<uint32_t>> leaf_pixels);

}  // namespace pepeseg
