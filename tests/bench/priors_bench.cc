// Measures the quality of priors, embedded ones and SAM's, without training: the best IoU of each
// ground-truth entity with one mask, in each labelled view; the rank correlation of the depth with
// the capture's own; and the time to make them.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <memory>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "core/priors/embedded_depth.h"
#include "core/priors/embedded_masks.h"
#include "core/priors/sam/automatic_masks.h"
#include "core/priors/sam/sam_segmenter.h"
#include "core/scene/capture.h"
#include "tests/bench/answer_cache.h"
#include "tests/bench/bench_clock.h"
#include "tests/bench/capture_pack.h"
#include "tests/bench/mask_scores.h"

namespace pepeseg {
namespace {

// Returns whether a mask crosses no entity: for each entity, the mask holds nearly all or nearly
// nothing of it, or lies nearly completely inside it.
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

// Returns Spearman's rank correlation of z, given as z or as disparity, over the pixels that both
// have.
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

// One way of prompting SAM, in a comparison.
struct SamVariant {
  const char* name;
  AutomaticMaskOptions options;
};
std::vector<SamVariant> SamVariants() {
  const auto variant = [](int points_per_side, bool region_points, double settled_area) {
    AutomaticMaskOptions options;
    options.points_per_side = points_per_side;
    options.region_points = region_points;
    options.settled_area = settled_area;
    return options;
  };
  std::vector<SamVariant> variants = {
      {"grid 16", variant(16, false, 0)},
      {"grid 12", variant(12, false, 0)},
      {"grid 8", variant(8, false, 0)},
      {"regions", variant(0, true, 0)},
      {"regions, grid 16", variant(16, true, 0)},
      {"regions, grid 12", variant(12, true, 0)},
      {"regions, grid 8", variant(8, true, 0)},
      {"regions, grid 16, settled 0.01", variant(16, true, 0.01)},
      {"regions, grid 16, settled 0.02", variant(16, true, 0.02)},
      {"regions, grid 16, settled 0.05", variant(16, true, 0.05)},
      {"regions, grid 16, settled 0.1", variant(16, true, 0.1)},
      {"regions, grid 16, settled 1", variant(16, true, 1)},
      {"regions, grid 12, settled 0.02", variant(12, true, 0.02)},
      {"grid 16, settled 0.02", variant(16, false, 0.02)},
      {"grid 16, no remainders", variant(16, false, 0)},
      {"grid 16, thresholds of SAM", variant(16, false, 0)},
  };
  variants[14].options.min_remainder_iou = 1;
  variants[15].options.min_iou = variants[15].options.min_filler_iou = 0.88;
  variants[15].options.min_stability = variants[15].options.min_filler_stability = 0.95;
  return variants;
}

struct BenchOptions {
  std::string pack;
  int every = 1;  // only every n-th view
  bool given_masks = false;
  std::string depth = "given";        // depth for making masks: "given", "none" or "embedded"
  int max_masks = kMaxEmbeddedMasks;  // of a view
  std::string sam;      // folder of deploy/sam.sh; empty: embedded masks instead of SAM
  int num_threads = 1;  // of SAM
};

// Sums over the views so far.
class PriorsBench {
 public:
  PriorsBench(const BenchOptions& options, CapturePack pack)
      : options_(options), pack_(std::move(pack)) {}

  void Run() {
    for (size_t i = 0; i < pack_.capture.views.size(); i += options_.every) {
      View& view = pack_.capture.views[i];
      ++num_views_;
      if (!options_.given_masks) AddDepth(view);
      const double start = Now();
      if (!options_.given_masks) view.masks = EmbeddedMasks(view, options_.max_masks).masks;
      mask_seconds_ += Now() - start;
      AddMasks(i);
    }
    Print();
  }

 private:
  // Compares embedded depth with the capture's own, and gives the view the depth of --depth.
  void AddDepth(View& view) {
    const double start = Now();
    const std::vector<float> depth = EmbeddedDepth(view, pack_.capture.points);
    depth_seconds_ += Now() - start;
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
    scores_.Add(masks, pack_.truth, index);
  }
  void Print() const {
    std::printf("%d views, %.1f masks and %.3f s a view, %.3f of the masks cross no entity\n",
                num_views_, num_masks_ / num_views_, mask_seconds_ / num_views_,
                num_whole_ / num_masks_);
    for (const auto& [name, sum] : scores_.of_level()) {
      std::printf("%-8s best IoU %.3f over %d\n", name.c_str(), sum.first / sum.second, sum.second);
    }
    if (num_depths_ == 0) return;
    std::printf("depth: rank correlation %.3f over %d views, %.3f of the pixels, %.3f s a view\n",
                correlation_ / num_depths_, num_depths_, known_ / num_depths_,
                depth_seconds_ / num_views_);
  }

  const BenchOptions& options_;
  CapturePack pack_;
  MaskScores scores_;
  double num_masks_ = 0, num_whole_ = 0, mask_seconds_ = 0;
  double correlation_ = 0, known_ = 0, depth_seconds_ = 0;
  int num_views_ = 0, num_depths_ = 0;
};

// Compares ways of prompting SAM. Each prompt runs once and all variants use its answer. The cost
// of a variant is that of the embedding plus its number of prompts times their mean processor time.
class SamBench {
 public:
  SamBench(const BenchOptions& options, CapturePack pack,
           std::unique_ptr<PromptedSegmenter> segmenter)
      : options_(options), pack_(std::move(pack)), cache_(std::move(segmenter)) {
    for (const SamVariant& variant : SamVariants()) {
      for (const bool joined : {false, true}) rows_.push_back({variant, joined});
    }
  }

  absl::Status Run() {
    for (size_t i = 0; i < pack_.capture.views.size(); i += options_.every) {
      View& view = pack_.capture.views[i];
      given_.Add(view.masks, pack_.truth, i);
      if (options_.depth == "none") view.depth = {};
      if (options_.depth == "embedded") {
        const std::vector<float> depth = EmbeddedDepth(view, pack_.capture.points);
        view.depth = {DepthPrior::Kind::kDepth, NormalizeDepth(depth), true};
      }
      const MaskSet embedded = EmbeddedMasks(view, options_.max_masks).masks;
      embedded_.Add(embedded, pack_.truth, i);
      for (Row& row : rows_) {
        row.variant.options.join_embedded = row.joined;
        auto made = SegmentPhotograph(cache_, view, embedded, row.variant.options,
                                      [] { return absl::OkStatus(); });
        if (!made.ok()) return made.status();
        row.num_prompts += made->num_prompts;
        row.scores.Add(made->masks, pack_.truth, i);
      }
      ++num_views_;
    }
    Print();
    return absl::OkStatus();
  }

 private:
  struct Row {
    SamVariant variant;
    bool joined;  // with the embedded masks
    MaskScores scores = {};
    int num_prompts = 0;
  };

  void PrintRow(const char* name, const MaskScores& scores, double prompts, double seconds) const {
    std::printf("| %s | %.0f | %.1f | %.0f |", name, prompts, seconds, scores.masks_per_view());
    for (const auto& [level, sum] : scores.of_level()) {
      std::printf(" %.3f |", sum.first / sum.second);
    }
    std::printf("\n");
  }
  void Print() const {
    std::printf("%d views; embedding %.2f s, prompt %.4f s of processors\n\n", num_views_,
                cache_.seconds_per_photograph(), cache_.seconds_per_prompt());
    std::printf("| masks | prompts | processor s | masks per view |");
    for (const auto& [level, sum] : given_.of_level()) std::printf(" %s |", level.c_str());
    std::printf("\n");
    PrintRow("the dataset's", given_, 0, 0);
    PrintRow("embedded", embedded_, 0, 0);
    for (const Row& row : rows_) {
      const double prompts = double(row.num_prompts) / num_views_;
      const double seconds =
          cache_.seconds_per_photograph() + prompts * cache_.seconds_per_prompt();
      const std::string name =
          std::string(row.variant.name) + (row.joined ? ", with embedded" : "");
      PrintRow(name.c_str(), row.scores, prompts, seconds);
    }
  }

  const BenchOptions& options_;
  CapturePack pack_;
  AnswerCache cache_;
  std::vector<Row> rows_;
  MaskScores given_, embedded_;
  int num_views_ = 0;
};

int RunBench(const BenchOptions& options) {
  absl::StatusOr<CapturePack> pack = ReadCapturePack(options.pack);
  absl::Status status = pack.status();
  if (pack.ok() && options.sam.empty()) PriorsBench(options, *std::move(pack)).Run();
  if (pack.ok() && !options.sam.empty()) {
    const auto sam = SamModel::Open(options.sam, {options.num_threads});
    status = sam.status();
    if (sam.ok()) status = SamBench(options, *std::move(pack), (*sam)->MakeSegmenter()).Run();
  }
  if (status.ok()) return 0;
  std::fprintf(stderr, "%s\n", status.ToString().c_str());
  return 1;
}

}  // namespace
}  // namespace pepeseg

// NOLINTNEXTLINE(bugprone-exception-escape): CLI11 throws only what CLI11_PARSE catches.
int main(int argc, char** argv) {
  CLI::App app("How good priors of a capture pack are");
  pepeseg::BenchOptions options;
  app.add_option("pack", options.pack)->required();
  app.add_option("--every", options.every, "only every n-th view")->check(CLI::PositiveNumber);
  app.add_option("--masks", options.max_masks, "maximum number of masks of a view");
  app.add_option("--depth", options.depth, "depth for making masks")
      ->check(CLI::IsMember({"given", "none", "embedded"}));
  app.add_flag("--given-masks", options.given_masks,
               "score the capture's own masks, for comparison");
  app.add_option("--sam", options.sam, "folder of deploy/sam.sh: compare ways of prompting SAM");
  app.add_option("--threads", options.num_threads, "threads of SAM");
  CLI11_PARSE(app, argc, argv);
  return pepeseg::RunBench(options);
}
