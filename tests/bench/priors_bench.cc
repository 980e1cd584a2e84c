// How good embedded priors are, before anything is trained: of each entity that a capture's ground
// truth names, in each labelled view, the best IoU with one mask; the rank correlation of the depth
// with the capture's own; and the time that making them takes.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <map>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "core/priors/embedded_depth.h"
#include "core/priors/embedded_masks.h"
#include "core/scene/normalize_depth.h"
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

double Seconds(std::chrono::steady_clock::time_point since) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - since).count();
}

struct BenchOptions {
  std::string pack;
  int every = 1;  // only every n-th view
  bool given_masks = false;
  std::string depth = "given";  // that masks are made with: "given", "none", "embedded"
  EmbeddedMaskOptions masks;
};

// What the views looked at give, summed up.
class PriorsBench {
 public:
  PriorsBench(const BenchOptions& options, CapturePack pack)
      : options_(options), pack_(std::move(pack)) {}

  void Run() {
    for (size_t i = 0; i < pack_.capture.views.size(); i += options_.every) {
      View& view = pack_.capture.views[i];
      ++num_views_;
      if (!options_.given_masks) AddDepth(view);
      const auto start = std::chrono::steady_clock::now();
      if (!options_.given_masks) view.masks = EmbeddedMasks(view, options_.masks).masks;
      mask_seconds_ += Seconds(start);
      AddMasks(i);
    }
    Print();
  }

 private:
  // Compares embedded depth with the capture's own, and leaves the view with what is asked for.
  void AddDepth(View& view) {
    const auto start = std::chrono::steady_clock::now();
    const std::vector<float> depth = EmbeddedDepth(view, pack_.capture.points);
    depth_seconds_ += Seconds(start);
    if (!depth.empty() && HasDepthPrior(view)) {
      const auto known =
          std::count_if(depth.begin(), depth.end(), [](float z) { return std::isfinite(z); });
      known_ += static_cast<double>(known) / static_cast<double>(depth.size());
      correlation_ += RankCorrelation(depth, view.depth);
      ++num_depths_;
    }
    if (options_.depth == "none") view.depth = {};
    if (options_.depth == "embedded") {
      view.depth = {DepthPrior::Kind::kDepth, NormalizeDepth(depth), true};
    }
  }
  void AddMasks(size_t index) {
    const MaskSet& masks = pack_.capture.views[index].masks;
    num_masks_ += masks.num_masks;
    for (int k = 0; k < masks.num_masks; ++k) {
      const BinaryMask mask = masks.Extract(k);
      num_whole_ += std::any_of(pack_.truth.begin(), pack_.truth.end(), [&](const auto& level) {
        return !level.labels[index].empty() &&
               IsWhole(mask, masks.mask_area[k], level.labels[index]);
      });
    }
    for (const TruthLevel& level : pack_.truth) {
      if (level.labels[index].empty()) continue;
      for (const auto& [label, best] : BestIous(masks, level.labels[index])) {
        if (best.second < kMinPixels) continue;
        auto& [sum, count] = of_level_[level.name];
        sum += best.first;
        ++count;
      }
    }
  }
  void Print() const {
    std::printf("%d views, %.1f masks and %.3f s a view, %.3f of the masks cross no entity\n",
                num_views_, num_masks_ / num_views_, mask_seconds_ / num_views_,
                num_whole_ / num_masks_);
    for (const auto& [name, sum] : of_level_) {
      std::printf("%-8s best IoU %.3f over %d\n", name.c_str(), sum.first / sum.second, sum.second);
    }
    if (num_depths_ == 0) return;
    std::printf("depth: rank correlation %.3f over %d views, %.3f of the pixels, %.3f s a view\n",
                correlation_ / num_depths_, num_depths_, known_ / num_depths_,
                depth_seconds_ / num_views_);
  }

  const BenchOptions& options_;
  CapturePack pack_;
  std::map<std::string, std::pair<double, int>> of_level_;
  double num_masks_ = 0, num_whole_ = 0, mask_seconds_ = 0;
  double correlation_ = 0, known_ = 0, depth_seconds_ = 0;
  int num_views_ = 0, num_depths_ = 0;
};

}  // namespace
}  // namespace pepeseg

// NOLINTNEXTLINE(bugprone-exception-escape): CLI11 throws only what CLI11_PARSE catches.
int main(int argc, char** argv) {
  CLI::App app("How good embedded priors of a capture pack are");
  pepeseg::BenchOptions options;
  app.add_option("pack", options.pack)->required();
  app.add_option("--every", options.every, "only every n-th view")->check(CLI::PositiveNumber);
  app.add_option("--masks", options.masks.max_masks, "of a view, at most");
  app.add_option("--depth", options.depth, "that masks are made with")
      ->check(CLI::IsMember({"given", "none", "embedded"}));
  app.add_flag("--given-masks", options.given_masks, "the capture's own, for comparison");
  CLI11_PARSE(app, argc, argv);
  absl::StatusOr<pepeseg::CapturePack> pack = pepeseg::ReadCapturePack(options.pack);
  if (!pack.ok()) {
    std::fprintf(stderr, "%s\n", pack.status().ToString().c_str());
    return 1;
  }
  pepeseg::PriorsBench(options, *std::move(pack)).Run();
  return 0;
}
