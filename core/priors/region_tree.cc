#include "core/priors/region_tree.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <queue>
#include <tuple>
#include <utility>

namespace pepeseg {
namespace {

// Weight of the boundary strength along the common border in the dissimilarity of two regions; the
// distance of their histograms has the rest.
constexpr float kBorderShare = 0.6f;
// Share of the image below which a region is merged earlier, so that fragments do not last.
constexpr double kSmallRegion = 0.002;

// Catchment basins of the boundary strength, the leaves of the tree: each pixel flows to its lowest
// neighbour of 8, and the pixels that reach the same minimum form a basin.
class Basins {
 public:
  Basins(std::span<const float> strength, int width, int height)
      : strength_(strength), width_(width), height_(height), to_(strength.size()) {
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) to_[Index(x, y)] = Lowest(x, y);
    }
  }

  // Writes the basin of each pixel to `of_pixel`, numbered from 0 in reading order, and returns the
  // number of basins.
  int Number(std::vector<int32_t>& of_pixel) {
    // Reading order decides the numbers, and through ties between offers the tree.
    std::vector<int32_t> number(to_.size(), -1);
    of_pixel.resize(to_.size());
    int num = 0;
    for (int32_t i = 0; i < static_cast<int32_t>(to_.size()); ++i) {
      const int32_t sink = Sink(i);
      if (number[sink] < 0) number[sink] = num++;
      of_pixel[i] = number[sink];
    }
    return num;
  }

 private:
  int32_t Index(int x, int y) const { return y * width_ + x; }

  // Equal strengths are ordered by index, so that plateaus have one minimum and no cycles.
  bool IsLower(int32_t a, int32_t b) const {
    return strength_[a] != strength_[b] ? strength_[a] < strength_[b] : a < b;
  }
  int32_t Lowest(int x, int y) const {
    int32_t lowest = Index(x, y);
    for (int v = std::max(0, y - 1); v <= std::min(height_ - 1, y + 1); ++v) {
      for (int u = std::max(0, x - 1); u <= std::min(width_ - 1, x + 1); ++u) {
        if (IsLower(Index(u, v), lowest)) lowest = Index(u, v);
      }
    }
    return lowest;
  }
  // Returns the minimum that a pixel flows to, and points the pixels on the way straight to it.
  int32_t Sink(int32_t pixel) {
    int32_t sink = pixel;
    while (to_[sink] != sink) sink = to_[sink];
    while (to_[pixel] != sink) pixel = std::exchange(to_[pixel], sink);
    return sink;
  }

  std::span<const float> strength_;
  int width_, height_;
  std::vector<int32_t> to_;  // [pixels] next pixel downhill; a minimum points to itself
};

// The common border of two regions: the pairs of adjacent pixels, one in each.
struct Border {
  int64_t length = 0;   // pairs
  int64_t weak = 0;     // pairs with a strength below PixelFeatures::weak
  double strength = 0;  // sum over the pairs of the larger strength of the two pixels

  void Add(const Border& other) {
    length += other.length;
    weak += other.weak;
    strength += other.strength;
  }
};

// Merges the two most alike neighbours until one region is left. A queue holds an offer for each
// pair of neighbours; an offer is stale, and skipped, once one of its regions has a parent.
class Merger {
 public:
  Merger(const PixelFeatures& pixels, RegionTree& tree) : pixels_(pixels), tree_(tree) {
    num_bins_ = pixels.bins.size();
    tree_.nodes.resize(tree.num_leaves);
    // A binary tree of n leaves has 2 n - 1 nodes.
    histograms_.resize(static_cast<size_t>(2 * tree.num_leaves) * num_bins_);
    borders_.resize(tree.num_leaves);
    for (size_t i = 0; i < tree.pixel_leaf.size(); ++i) {
      const int32_t leaf = tree.pixel_leaf[i];
      ++tree_.nodes[leaf].area;
      for (size_t b = 0; b < num_bins_; ++b) histograms_[leaf * num_bins_ + b] += pixels.bins[b][i];
    }
    FindBorders();
  }

  void Run() {
    for (int32_t a = 0; a < tree_.num_leaves; ++a) {
      for (const auto& [b, border] : borders_[a]) {
        if (a < b) Offer(a, b, border);
      }
      SetContrast(a);
    }
    while (!offers_.empty()) {
      const Offered best = offers_.top();
      offers_.pop();
      if (tree_.nodes[best.a].parent < 0 && tree_.nodes[best.b].parent < 0) Merge(best);
    }
  }

 private:
  struct Offered {
    float dissimilarity;
    int32_t a, b;
    bool operator<(const Offered& other) const {  // the smallest on top, ties by index
      return std::tie(dissimilarity, a, b) > std::tie(other.dissimilarity, other.a, other.b);
    }
  };

  void AddBorder(int32_t i, int32_t j) {
    const int32_t a = tree_.pixel_leaf[i], b = tree_.pixel_leaf[j];
    if (a == b) return;
    const float strength = std::max(pixels_.strength[i], pixels_.strength[j]);
    for (const auto& [from, to] : {std::pair{a, b}, {b, a}}) {
      borders_[from][to].Add({1, strength < pixels_.weak ? 1 : 0, strength});
    }
  }
  void FindBorders() {
    for (int32_t y = 0; y < pixels_.height; ++y) {
      for (int32_t x = 0; x < pixels_.width; ++x) {
        const int32_t at = y * pixels_.width + x;
        if (x + 1 < pixels_.width) AddBorder(at, at + 1);
        if (y + 1 < pixels_.height) AddBorder(at, at + pixels_.width);
      }
    }
  }

  // Returns the chi-squared distance of two regions' mean histograms.
  float HistogramDistance(int32_t a, int32_t b) const {
    const double area_a = static_cast<double>(tree_.nodes[a].area);
    const double area_b = static_cast<double>(tree_.nodes[b].area);
    double sum = 0;
    for (size_t k = 0; k < num_bins_; ++k) {
      const double g = histograms_[a * num_bins_ + k] / area_a;
      const double h = histograms_[b * num_bins_ + k] / area_b;
      sum += pixels_.bin_weights[k] * (g - h) * (g - h) / (g + h + 1e-6);
    }
    return static_cast<float>(std::sqrt(0.5 * sum));
  }
  // Queues the merge of a and b with the dissimilarity
  //   (kBorderShare strength + (1 - kBorderShare) distance) min(1, share / kSmallRegion)^0.4,
  // share: the smaller region's share of the image.
  void Offer(int32_t a, int32_t b, const Border& border) {
    // A pair's border has at least one pair of pixels.
    const double mean = border.strength / static_cast<double>(border.length);
    const double smaller = static_cast<double>(std::min(tree_.nodes[a].area, tree_.nodes[b].area));
    const double share = smaller / static_cast<double>(pixels_.strength.size());
    const double readiness = std::pow(std::min(1.0, share / kSmallRegion), 0.4);
    const double distance =
        kBorderShare * mean + (1 - kBorderShare) * double{HistogramDistance(a, b)};
    offers_.push({static_cast<float>(distance * readiness), a, b});
  }
  void SetContrast(int32_t node) {
    Border all;
    for (const auto& [other, border] : borders_[node]) all.Add(border);
    if (all.length == 0) return;
    const auto length = static_cast<double>(all.length);
    tree_.nodes[node].contrast = static_cast<float>(all.strength / length);
    tree_.nodes[node].weak = static_cast<float>(static_cast<double>(all.weak) / length);
  }
  void Merge(const Offered& best) {
    const auto made = static_cast<int32_t>(tree_.nodes.size());
    RegionTree::Node& node = tree_.nodes.emplace_back();
    node.children[0] = best.a;
    node.children[1] = best.b;
    node.height = best.dissimilarity;
    for (const int32_t child : node.children) {
      tree_.nodes[child].parent = made;
      node.area += tree_.nodes[child].area;
      // Heights never fall towards the root, also where a small region's offer was made cheaper.
      node.height = std::max(node.height, tree_.nodes[child].height);
      for (size_t k = 0; k < num_bins_; ++k) {
        histograms_[made * num_bins_ + k] += histograms_[child * num_bins_ + k];
      }
    }
    JoinBorders(best.a, best.b, made);
    SetContrast(made);
  }
  // Gives `made` the borders of its children, without the one between them, and offers each.
  void JoinBorders(int32_t a, int32_t b, int32_t made) {
    std::map<int32_t, Border> joined;
    for (const int32_t child : {a, b}) {
      for (const auto& [other, border] : borders_[child]) {
        if (other == a || other == b) continue;
        joined[other].Add(border);
        borders_[other].erase(child);
      }
      borders_[child].clear();
    }
    for (const auto& [other, border] : joined) {
      borders_[other][made] = border;
      Offer(other, made, border);
    }
    borders_.push_back(std::move(joined));
  }

  const PixelFeatures& pixels_;
  RegionTree& tree_;
  size_t num_bins_;
  std::vector<double> histograms_;                  // [nodes, bins] sums over the pixels
  std::vector<std::map<int32_t, Border>> borders_;  // [nodes] by neighbour; empty with a parent
  std::priority_queue<Offered> offers_;
};

}  // namespace

RegionTree BuildRegionTree(const PixelFeatures& pixels) {
  RegionTree tree;
  tree.num_leaves = Basins(pixels.strength, pixels.width, pixels.height).Number(tree.pixel_leaf);
  Merger(pixels, tree).Run();
  return tree;
}

std::vector<uint32_t> PixelsOf(const RegionTree& tree, int32_t node,
                               std::span<const std::vector<uint32_t>> leaf_pixels) {
  std::vector<uint32_t> pixels;
  pixels.reserve(static_cast<size_t>(tree.nodes[node].area));
  std::vector<int32_t> left = {node};
  while (!left.empty()) {
    const int32_t at = left.back();
    left.pop_back();
    if (at < tree.num_leaves) {
      pixels.insert(pixels.end(), leaf_pixels[at].begin(), leaf_pixels[at].end());
    } else {
      left.insert(left.end(), std::begin(tree.nodes[at].children),
                  std::end(tree.nodes[at].children));
    }
  }
  return pixels;
}

}  // namespace pepeseg
