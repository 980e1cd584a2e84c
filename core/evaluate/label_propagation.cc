#include "core/evaluate/label_propagation.h"

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/evaluate/prompt_queries.h"
#include "core/query/prompt.h"

namespace pepeseg {
namespace {

constexpr size_t kMostCentroids = kMaxQueries;
// Limits of what PropagatedMasks keeps: 64 MiB of centroids, 256 MiB of labels.
constexpr size_t kMostCentroidValues = size_t{16} << 20;
constexpr size_t kMostLabels = size_t{64} << 20;

absl::Status CheckShare(absl::string_view name, double value, double low) {
  const bool over = low < 0 ? value >= low : value > low;
  if (over && value <= 1) return absl::OkStatus();  // false for NaN
  return absl::InvalidArgumentError(absl::StrCat("label_propagation.", name, " is ", value,
                                                 ", must be in ", low < 0 ? "[-1" : "(0", ", 1]"));
}

// The clusters of a reference view, with what its entities' masks select from them.
class ReferenceClusters {
 public:
  ReferenceClusters(const QueryTask& query_task, size_t view, ViewClusters clusters,
                    const LabelPropagationOptions& options)
      : query_task_(query_task), view_(view), clusters_(std::move(clusters)), options_(options) {}

  size_t view() const { return view_; }

  // Returns the query at a scale for the entity with this mask, without features if it selects no
  // cluster.
  absl::StatusOr<Query> QueryFor(std::span<const uint8_t> mask, double scale) {
    RETURN_IF_ERROR(query_task_.check_cancelled());
    ASSIGN_OR_RETURN(const ScaleClusters* at_scale, clusters_.At(scale));
    std::vector<uint8_t> inside;
    for (const int32_t pixel : clusters_.pixels()) {
      inside.push_back(mask[static_cast<size_t>(pixel)]);
    }
    std::vector<int> selected = SelectClusters(at_scale->clusters, inside, options_);
    if (selected.size() > kMostCentroids) selected.resize(kMostCentroids);
    Query query = {{}, std::vector<uint8_t>(selected.size(), 1), scale, options_.min_cosine};
    for (const int cluster : selected) {
      const auto first = at_scale->centroids.begin() + ptrdiff_t{cluster} * kFeatureSize;
      query.features.insert(query.features.end(), first, first + kFeatureSize);
    }
    return query;
  }

 private:
  const QueryTask& query_task_;
  const size_t view_;
  ViewClusters clusters_;
  const LabelPropagationOptions& options_;
};

// Returns for each of the centroids, [n, 32] and not gated, whether it corresponds to a feature of
// the query.
std::vector<uint8_t> Correspondences(const Query& query, std::span<const float> centroids,
                                     std::span<const float> gate, double min_cosine) {
  const auto scale = static_cast<float>(query.scale);
  const std::vector<float> wanted = GatedUnits(query.features, gate, scale);
  const std::vector<float> units = GatedUnits(centroids, gate, scale);
  std::vector<uint8_t> corresponds(units.size() / kFeatureSize);
  for (size_t c = 0; c < corresponds.size(); ++c) {
    const float* unit = &units[c * kFeatureSize];
    for (size_t q = 0; q < wanted.size(); q += kFeatureSize) {
      const float cosine = std::inner_product(unit, unit + kFeatureSize, &wanted[q], 0.0f);
      if (double{cosine} > min_cosine) corresponds[c] = 1;
    }
  }
  return corresponds;
}

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
      const TruthView& truth = query_task.task.views[entity.reference];
      ASSIGN_OR_RETURN(
          ViewClusters clusters,
          ViewClusters::Sample(query_task.segmenter, truth.view, options.max_pixels, truth.ignore));
      reference.emplace(query_task, entity.reference, std::move(clusters), options);
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

absl::StatusOr<BinaryMask> PropagatedMasks::In(size_t view, const Query& query) {
  if (view != view_) {
    view_ = view;
    clusters_.reset();
    labels_.clear();
  }
  ASSIGN_OR_RETURN(const std::vector<float>* centroids, CentroidsIn(query.scale));
  ASSIGN_OR_RETURN(const std::vector<int32_t>* labels, LabelsIn(query.scale, *centroids));
  const std::vector<uint8_t> corresponds = Correspondences(
      query, *centroids, query_task_.segmenter.model().field.gate, options_.min_cosine);
  BinaryMask mask;
  mask.pixels.reserve(labels->size());
  for (const int32_t label : *labels) {
    mask.pixels.push_back(label == kNoise ? 0 : corresponds[static_cast<size_t>(label)]);
  }
  return mask;
}

absl::StatusOr<const std::vector<float>*> PropagatedMasks::CentroidsIn(double scale) {
  const auto known = centroids_.find({view_, scale});
  if (known != centroids_.end()) return &known->second;
  RETURN_IF_ERROR(query_task_.check_cancelled());
  if (!clusters_) {
    ASSIGN_OR_RETURN(clusters_,
                     ViewClusters::Sample(query_task_.segmenter, query_task_.task.views[view_].view,
                                          options_.max_pixels));
  }
  ASSIGN_OR_RETURN(const ScaleClusters* at_scale, clusters_->At(scale));
  num_centroid_values_ += at_scale->centroids.size();
  if (num_centroid_values_ > kMostCentroidValues) {
    centroids_.clear();
    num_centroid_values_ = at_scale->centroids.size();
  }
  return &(centroids_[{view_, scale}] = at_scale->centroids);
}

absl::StatusOr<const std::vector<int32_t>*> PropagatedMasks::LabelsIn(
    double scale, std::span<const float> centroids) {
  const auto known = labels_.find(scale);
  if (known != labels_.end()) return &known->second;
  ASSIGN_OR_RETURN(std::vector<int32_t> labels,
                   NearestCentroids(query_task_.segmenter, query_task_.task.views[view_].view,
                                    centroids, scale));
  if ((labels_.size() + 1) * labels.size() > kMostLabels) labels_.clear();
  return &(labels_[scale] = std::move(labels));
}

}  // namespace pepeseg
