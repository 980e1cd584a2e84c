#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace pepeseg {

// A photograph cut into small regions, and which of them are merged in which order: every node is a
// region, its children lie inside it (after Arbelaez et al., "Contour Detection and Hierarchical
// Image Segmentation", 2011).
struct RegionTree {
  struct Node {
    int32_t parent = -1;  // -1: the root
    int32_t children[2] = {-1, -1};
    int64_t area = 0;    // pixels
    float height = 0;    // the dissimilarity at which it was merged from its children; 0: leaf
    float contrast = 0;  // mean boundary strength along its border, the image's left out
    float weak = 0;      // share of that border where the strength is under the weak one
  };
  std::vector<Node> nodes;          // leaves first, children before parents
  std::vector<int32_t> pixel_leaf;  // [height * width]
  int num_leaves = 0;
};

struct PixelFeatures {
  int width = 0, height = 0;
  std::span<const float> strength;       // [height, width] of boundaries
  float weak = 0;                        // what is hardly a boundary
  std::vector<std::vector<float>> bins;  // [bins][height * width]: histograms, summed over a region
  std::vector<float> bin_weights;        // [bins] of their chi-squared distance
};

RegionTree BuildRegionTree(const PixelFeatures& pixels);

// Those of a node's leaves, one after the other.
std::vector<uint32_t> PixelsOf(const RegionTree& tree, int32_t node,
                               std::span<const std::vector<uint32_t>> leaf_pixels);

}  // namespace pepeseg
