// How good embedded priors are, before anything is trained: of each entity that a capture's ground
// truth names, in each labelled view, the best IoU with one mask; the rank correlation of the depth
// with the capture's own; and the time that making them takes.
//   pepeseg_mask_bench PACK [--given] [--without-depth] [--every N] [--masks N]
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "core/priors/embedded_depth.h"
#include "core/priors/embedded_masks.h"
#include "tests/bench/capture_pack.h"

namespace pepeseg {
namespace {

constexpr int64_t kMinPixels = 100;  // of an entity in a view, as in the one-click protocol

// By entity: the best IoU and the pixels.
std::map<uint16_t, std::pair<double, int64_t>> BestIous(const MaskSet& masks,
                                                        const std::vector<uint16_t>& labels) {
  std::map<uint16_t, std::pair<double, int64_t>> best;
  for (const uint16_t label : labels) {
    if (label != 0) ++best[label].second;
  }
  for (int k = 0; k < masks.num_masks; ++k) {
    std::map<uint16_t, int64_t> inside;
    const BinaryMask mask = masks.Extract(k);
    for (size_t i = 0; i < labels.size(); ++i) {
      if (mask.pixels[i] != 0) ++inside[labels[i]];
    }
    for (const auto& [label, both] : inside) {
      if (label == 0) continue;
      auto& [iou, num_pixels] = best[label];
      const auto either = static_cast<double>(num_pixels + masks.mask_area[k] - both);
      iou = std::max(iou, static_cast<double>(both) / either);
    }
  }
  return best;
}

// Whether a mask crosses no entity: each it has of the one, or the other has of it, nearly all or
// nearly nothing.
bool IsWhole(const BinaryMask& mask, int64_t area, const std::vector<uint16_t>& labels) {
  std::map<uint16_t, std::pair<int64_t, int64_t>> of_label;  // inside, all
  for (size_t i = 0; i < labels.size(); ++i) {
    auto& [inside, all] = of_label[labels[i]];
    inside += mask.pixels[i];
    ++all;
  }
  for (const auto& [label, counts] : of_label) {
    const double share =
        static_cast<double>(counts.first) / static_cast<double>(std::min(area, counts.second));
    if (share > 0.1 && share < 0.9) return false;
  }
  return true;
}

// Of the pixels that both know, Spearman's rank correlation of z, either as z or as disparity.
double RankCorrelation(const std::vector<float>& depth, const DepthPrior& given) {
  std::vector<uint32_t> pixels;
  for (uint32_t i = 0; i < depth.size(); ++i) {
    if (std::isfinite(depth[i]) && std::isfinite(given.values[i])) pixels.push_back(i);
  }
  const auto ranks = [&pixels](const std::vector<float>& values) {
    std::vector<uint32_t> order(pixels.size());
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(),
                     [&](uint32_t a, uint32_t b) { return values[pixels[a]] < values[pixels[b]]; });
    std::vector<double> rank(order.size());
    for (size_t first = 0; first < order.size();) {  // equal values share their mean rank
      size_t end = first + 1;
      while (end < order.size() && values[pixels[order[end]]] == values[pixels[order[first]]])
        ++end;
      for (size_t i = first; i < end; ++i) {
        rank[order[i]] = 0.5 * static_cast<double>(first + end - 1);
      }
      first = end;
    }
    return rank;
  };
  const std::vector<double> a = ranks(depth), b = ranks(given.values);
  const double mean = 0.5 * (static_cast<double>(pixels.size()) - 1);
  double ab = 0, aa = 0, bb = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    ab += (a[i] - mean) * (b[i] - mean);
    aa += (a[i] - mean) * (a[i] - mean);
    bb += (b[i] - mean) * (b[i] - mean);
  }
  const double sign = given.kind == DepthPrior::Kind::kDisparity ? -1 : 1;
  return sign * ab / std::sqrt(aa * bb);
}

int Run(const std::string& path, bool given, bool without_depth, int every,
        const EmbeddedMaskOptions& options) {
  absl::StatusOr<CapturePack> pack = ReadCapturePack(path);
  if (!pack.ok()) {
    std::fprintf(stderr, "%s\n", pack.status().ToString().c_str());
    return 1;
  }
  std::map<std::string, std::pair<double, int>> of_level;
  double seconds = 0, num_masks = 0, num_whole = 0;
  double correlation = 0, known = 0, depth_seconds = 0;
  int num_views = 0, num_depths = 0;
  for (size_t i = 0; i < pack->capture.views.size(); i += every) {
    View& view = pack->capture.views[i];
    if (HasDepthPrior(view) && !given) {
      const auto start = std::chrono::steady_clock::now();
      const std::vector<float> depth = EmbeddedDepth(view, pack->capture.points);
      depth_seconds +=
          std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
      if (!depth.empty()) {
        known += static_cast<double>(std::count_if(depth.begin(), depth.end(),
                                                   [](float z) { return std::isfinite(z); })) /
                 static_cast<double>(depth.size());
        correlation += RankCorrelation(depth, view.depth);
        ++num_depths;
      }
      if (without_depth) view.depth = {};
    }
    const auto start = std::chrono::steady_clock::now();
    if (!given) view.masks = EmbeddedMasks(view, options).masks;
    seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    num_masks += view.masks.num_masks;
    ++num_views;
    for (int k = 0; k < view.masks.num_masks; ++k) {
      const BinaryMask mask = view.masks.Extract(k);
      bool whole = false;
      for (const TruthLevel& level : pack->truth) {
        whole |=
            !level.labels[i].empty() && IsWhole(mask, view.masks.mask_area[k], level.labels[i]);
      }
      num_whole += whole ? 1 : 0;
    }
    for (const TruthLevel& level : pack->truth) {
      if (level.labels[i].empty()) continue;
      for (const auto& [label, best] : BestIous(view.masks, level.labels[i])) {
        if (best.second < kMinPixels) continue;
        auto& [sum, count] = of_level[level.name];
        sum += best.first;
        ++count;
      }
    }
  }
  std::printf("%d views, %.1f masks and %.3f s a view, %.3f of the masks cross no entity\n",
              num_views, num_masks / num_views, seconds / num_views, num_whole / num_masks);
  if (num_depths > 0) {
    std::printf("depth: rank correlation %.3f over %d views, %.3f of the pixels, %.3f s a view\n",
                correlation / num_depths, num_depths, known / num_depths,
                depth_seconds / num_views);
  }
  for (const auto& [name, sum] : of_level) {
    std::printf("%-8s best IoU %.3f over %d\n", name.c_str(), sum.first / sum.second, sum.second);
  }
  return 0;
}

}  // namespace
}  // namespace pepeseg

int main(int argc, char** argv) {
  std::string path;
  bool given = false, without_depth = false;
  pepeseg::EmbeddedMaskOptions options;
  int every = 1;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (word == "--given") {
      given = true;
    } else if (word == "--without-depth") {
      without_depth = true;
    } else if (word == "--every" && i + 1 < argc) {
      every = std::max(1, std::atoi(argv[++i]));
    } else if (word == "--masks" && i + 1 < argc) {
      options.max_masks = std::atoi(argv[++i]);
    } else {
      path = word;
    }
  }
  if (path.empty()) {
    std::fprintf(
        stderr,
        "usage: pepeseg_mask_bench PACK [--given] [--without-depth] [--every N] [--masks N]\n");
    return 2;
  }
  return pepeseg::Run(path, given, without_depth, every, options);
}
