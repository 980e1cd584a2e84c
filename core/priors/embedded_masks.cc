#include "core/priors/embedded_masks.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <utility>
#include <vector>

#include "core/base/order_statistics.h"
#include "core/priors/boundaries.h"
#include "core/priors/photo_channels.h"
#include "core/priors/region_tree.h"

namespace pepeseg {
namespace {

constexpr int kMaskExtent = 512;  // pixels; longer side at which a larger photograph is processed
constexpr double kMinArea = 0.0008;     // smallest mask, as a share of the photograph
constexpr double kMaxArea = 0.7;        // largest mask, as a share of the photograph
constexpr double kMaxOpenBorder = 0.5;  // largest share of a mask's border without a boundary

// A view at the size at which it is processed.
struct SmallView {
  Image photo;
  std::vector<float> depth;  // [height, width]; empty: no depth prior
};

SmallView Shrunk(const View& view) {
  SmallView small;
  small.photo = ShrunkPhoto(view.photo, kMaskExtent);
  if (HasDepthPrior(view)) {
    const cv::Mat depth(view.photo.height, view.photo.width, CV_32F,
                        const_cast<float*>(view.depth.values.data()));
    cv::Mat to;
    // Nearest: a mean across a border would make a depth that nothing has, and NaN would spread.
    cv::resize(depth, to, {small.photo.width, small.photo.height}, 0, 0, cv::INTER_NEAREST);
    small.depth.assign(to.begin<float>(), to.end<float>());
  }
  return small;
}

// Returns the pixels of each leaf at the view's full size, without ignored ones.
std::vector<std::vector<uint32_t>> LeafPixels(const RegionTree& tree, const SmallView& small,
                                              const View& view) {
  std::vector<std::vector<uint32_t>> pixels(tree.num_leaves);
  const int width = view.photo.width, height = view.photo.height;
  for (int y = 0; y < height; ++y) {
    // Pixel of the small photograph above and to the left, in whole numbers.
    const int64_t row = int64_t{y} * small.photo.height / height * small.photo.width;
    for (int x = 0; x < width; ++x) {
      const size_t pixel = static_cast<size_t>(y) * width + x;
      if (!view.ignore.empty() && view.ignore[pixel] != 0) continue;
      const int32_t leaf = tree.pixel_leaf[row + int64_t{x} * small.photo.width / width];
      pixels[leaf].push_back(static_cast<uint32_t>(pixel));
    }
  }
  return pixels;
}

// Returns the strength below which a boundary is weak: the 75th percentile, because most pixels
// lie at no boundary.
float WeakStrength(std::vector<float> strength) {
  constexpr double kShare = 0.75;
  const double rank = kShare * static_cast<double>(strength.size());
  return ValueAtRank(strength, static_cast<size_t>(rank));
}

// Cuts the view into a tree of regions. A depth jump counts half as much as the same strength of
// colour and texture.
RegionTree TreeOf(const SmallView& small) {
  const PhotoChannels channels = ChannelsOf(small.photo);
  std::vector<float> strength = BoundaryStrength(channels);
  if (!small.depth.empty()) {
    const std::vector<float> jumps =
        DepthStrength(small.depth, small.photo.width, small.photo.height);
    for (size_t i = 0; i < jumps.size(); ++i) strength[i] = std::max(strength[i], 0.5f * jumps[i]);
  }
  PixelFeatures pixels{
      small.photo.width, small.photo.height, strength, WeakStrength(strength), {}, {}};
  for (const PhotoChannels::Group& group : channels.groups) {
    for (const cv::Mat& bin : group.bins) {
      pixels.bins.emplace_back(bin.begin<float>(), bin.end<float>());
      pixels.bin_weights.push_back(group.weight);
    }
  }
  return BuildRegionTree(pixels);
}

// Returns the quality of a region as a mask, see EmbeddedMaskSet::quality; 0 for the root. An
// object has a clear border all around; of two such regions the larger one is better.
double Quality(const RegionTree& tree, int32_t at) {
  constexpr double kSizeExponent = 0.15;
  const RegionTree::Node& node = tree.nodes[at];
  const double share = static_cast<double>(node.area) / static_cast<double>(tree.pixel_leaf.size());
  return node.parent < 0 ? 0 : (1 - double{node.weak}) * std::pow(share, kSizeExponent);
}

// Marks the regions that are nearly the same as `node`: ancestors and descendants with an IoU over
// kSame. Regions nest, so that the IoU is the ratio of the areas; at most one child can reach it.
void TakeAlike(const RegionTree& tree, int32_t node, std::vector<uint8_t>& taken) {
  constexpr double kSame = 0.8;  // IoU
  const auto area = [&](int32_t i) { return static_cast<double>(tree.nodes[i].area); };
  for (int32_t up = node; up >= 0 && area(node) > kSame * area(up); up = tree.nodes[up].parent) {
    taken[up] = 1;
  }
  for (int32_t down = node; down >= tree.num_leaves;) {
    const int32_t* children = tree.nodes[down].children;
    down = area(children[0]) > area(children[1]) ? children[0] : children[1];
    if (area(down) <= kSame * area(node)) break;
    taken[down] = 1;
  }
}

struct ChosenRegion {
  int32_t node;
  float quality;
};

// Returns the best regions, the best first, without those that are nearly the same as a better one.
std::vector<ChosenRegion> ChooseRegions(const RegionTree& tree, int max_count) {
  const auto num_pixels = static_cast<double>(tree.pixel_leaf.size());
  std::vector<std::pair<double, int32_t>> found;
  for (int32_t i = 0; i < static_cast<int32_t>(tree.nodes.size()); ++i) {
    const double share = static_cast<double>(tree.nodes[i].area) / num_pixels;
    if (share < kMinArea || share > kMaxArea) continue;
    if (tree.nodes[i].weak > kMaxOpenBorder) continue;
    // Negated: the best first, ties by index.
    found.emplace_back(-Quality(tree, i), i);
  }
  std::sort(found.begin(), found.end());
  std::vector<ChosenRegion> chosen;
  std::vector<uint8_t> taken(tree.nodes.size());
  for (const auto& [quality, node] : found) {
    if (chosen.size() == static_cast<size_t>(max_count)) break;
    if (taken[node] != 0) continue;
    chosen.push_back({node, static_cast<float>(-quality)});
    TakeAlike(tree, node, taken);
  }
  return chosen;
}

}  // namespace

EmbeddedMaskSet EmbeddedMasks(const View& view, int max_masks) {
  const SmallView small = Shrunk(view);
  const RegionTree tree = TreeOf(small);
  const std::vector<std::vector<uint32_t>> leaves = LeafPixels(tree, small, view);
  MaskSetBuilder builder(view.photo.width, view.photo.height);
  EmbeddedMaskSet made;
  for (const ChosenRegion& region : ChooseRegions(tree, max_masks)) {
    if (builder.Add(PixelsOf(tree, region.node, leaves))) made.quality.push_back(region.quality);
  }
  made.masks = std::move(builder).Build();
  return made;
}

}  // namespace pepeseg
