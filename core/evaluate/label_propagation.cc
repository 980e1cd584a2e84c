#include "core/evaluate/label_propagation.h"

#include <algorithm>
#include <map>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/backend_turn.h"
#include "core/base/status_macros.h"
#include "core/evaluate/prompt_queries.h"
#include "core/query/prompt.h"

namespace pepeseg {
namespace {

constexpr size_t kMostCentroids = kMaxQueries;
constexpr HdbscanOptions kHdbscan = {.min_cluster_size = 10, .min_samples = 5};

absl::Status CheckShare(absl::string_view name, double value, double low) {
  const bool over = low < 0 ? value >= low : value > low;
  if (over && value <= 1) return absl::OkStatus();  // false for NaN
  return absl::InvalidArgumentError(absl::StrCat("label_propagation.", name, " is ", value,
                                                 ", must be in ", low < 0 ? "[-1" : "(0", ", 1]"));
}

// The clusters of one reference view at several scales.
class ReferenceClusters {
 public:
  ReferenceClusters(const QueryTask& query_task, size_t view,
                    const LabelPropagationOptions& options)
      : query_task_(query_task), segmenter_(query_task.segmenter), view_(view), options_(options) {}

  size_t view() const { return view_; }

  // Samples the features of the view. Pixels that are ignored or show nothing are left out.
  absl::Status Sample() {
    const TruthView& truth = query_task_.task.views[view_];
    std::vector<int32_t> grid = GridPixels(truth.view.camera, options_.max_pixels);
    std::erase_if(grid, [&](int32_t pixel) {
      return !truth.ignore.empty() && truth.ignore[static_cast<size_t>(pixel)] != 0;
    });
    std::vector<size_t> found;
    ASSIGN_OR_RETURN(features_, SolidFeatures(segmenter_, truth.view, grid, &found));
    for (const size_t i : found) pixels_.push_back(grid[i]);
    return absl::OkStatus();
  }

  // Returns the query at a scale for the entity with this mask, without features if it selects no
  // cluster.
  absl::StatusOr<Query> QueryFor(std::span<const uint8_t> mask, double scale) {
    ASSIGN_OR_RETURN(const Clusters* clusters, At(scale));
    std::vector<uint8_t> inside;
    for (const int32_t pixel : pixels_) inside.push_back(mask[static_cast<size_t>(pixel)]);
    std::vector<int> selected = SelectClusters(*clusters, inside, options_);
    if (selected.size() > kMostCentroids) selected.resize(kMostCentroids);
    Query query = {{}, std::vector<uint8_t>(selected.size(), 1), scale, options_.min_cosine};
    for (const int cluster : selected) {
      const std::vector<float> centroid = CentroidOf(*clusters, cluster, scale);
      query.features.insert(query.features.end(), centroid.begin(), centroid.end());
    }
    return query;
  }

 private:
  absl::StatusOr<const Clusters*> At(double scale) {
    const auto known = by_scale_.find(scale);
    if (known != by_scale_.end()) return &known->second;
    RETURN_IF_ERROR(query_task_.check_cancelled());
    const std::vector<float> units =
        GatedUnits(features_, segmenter_.model().field.gate, static_cast<float>(scale));
    Backend& backend = segmenter_.backend();
    ASSIGN_OR_RETURN(Clusters clusters, InTurn(backend, [&] {
                       return Hdbscan(backend, std::span<const float>(units), kHdbscan);
                     }));
    return &by_scale_.emplace(scale, std::move(clusters)).first->second;
  }

  std::vector<float> CentroidOf(const Clusters& clusters, int cluster, double scale) const {
    std::vector<float> members;
    for (size_t i = 0; i < clusters.labels.size(); ++i) {
      if (clusters.labels[i] != cluster) continue;
      const auto first = features_.begin() + static_cast<int64_t>(i) * kFeatureSize;
      members.insert(members.end(), first, first + kFeatureSize);
    }
    return GatedMean(members, segmenter_.model().field.gate, static_cast<float>(scale));
  }

  const QueryTask& query_task_;
  const Segmenter& segmenter_;
  const size_t view_;
  const LabelPropagationOptions& options_;
  std::vector<int32_t> pixels_;          // y * width + x
  std::vector<float> features_;          // [pixels_, 32]
  std::map<double, Clusters> by_scale_;  // of pixels_
};

}  // namespace

absl::Status Validate(const LabelPropagationOptions& options) {
  RETURN_IF_ERROR(CheckShare("min_cosine", options.min_cosine, -1));
  RETURN_IF_ERROR(CheckShare("min_inside", options.min_inside, 0));
  RETURN_IF_ERROR(CheckShare("min_covered", options.min_covered, 0));
  constexpr int kFewestPixels = 64, kMostPixels = 65'536;
  if (options.max_pixels < kFewestPixels || options.max_pixels > kMostPixels) {
    return absl::InvalidArgumentError(absl::StrCat("label_propagation.max_pixels is ",
                                                   options.max_pixels, ", must be in [",
                                                   kFewestPixels, ", ", kMostPixels, "]"));
  }
  return absl::OkStatus();
}

std::vector<int> SelectClusters(const Clusters& clusters, std::span<const uint8_t> inside,
                                const LabelPropagationOptions& options) {
  std::vector<double> sizes(clusters.count), common(clusters.count);
  double mask_size = 0;
  for (size_t i = 0; i < inside.size(); ++i) {
    const double is_inside = inside[i] != 0 ? 1 : 0;
    mask_size += is_inside;
    if (clusters.labels[i] == kNoise) continue;
    ++sizes[clusters.labels[i]];
    common[clusters.labels[i]] += is_inside;
  }
  std::vector<int> selected;
  for (int c = 0; c < clusters.count; ++c) {
    if (common[c] > 0 && (common[c] >= options.min_inside * sizes[c] ||
                          common[c] >= options.min_covered * mask_size)) {
      selected.push_back(c);
    }
  }
  std::stable_sort(selected.begin(), selected.end(),
                   [&](int a, int b) { return common[a] > common[b]; });
  return selected;
}

absl::StatusOr<std::vector<EntityQueries>> LabelPropagationQueries(
    const QueryTask& query_task, const LabelPropagationOptions& options) {
  std::optional<ReferenceClusters> reference;  // of the entities that are made now
  return MakeQueries(query_task, [&](const ScoredEntity& entity) -> absl::StatusOr<EntityQueries> {
    ASSIGN_OR_RETURN(const BinaryMask mask, PromptMaskOf(query_task.task, entity));
    if (!reference || reference->view() != entity.reference) {
      reference.emplace(query_task, entity.reference, options);
      RETURN_IF_ERROR(reference->Sample());
    }
    EntityQueries queries;
    for (const double scale : query_task.scales) {
      ASSIGN_OR_RETURN(queries.by_scale.emplace_back(), reference->QueryFor(mask.pixels, scale));
    }
    ASSIGN_OR_RETURN(const double scale, AutomaticScale(query_task.segmenter, query_task.task,
                                                        entity, options.min_cosine));
    ASSIGN_OR_RETURN(queries.automatic, reference->QueryFor(mask.pixels, scale));
    return queries;
  });
}

}  // namespace pepeseg
