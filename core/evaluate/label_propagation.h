#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/cluster/hdbscan.h"
#include "core/evaluate/entity_queries.h"
#include "core/evaluate/evaluation_task.h"
#include "core/evaluate/view_clusters.h"
#include "core/query/segmenter.h"

// Protocol "label propagation" of SPIn-NeRF and LERF-Mask, as PePESeg3D evaluates it (METHOD.md
// section 5): the centroids of the entity come from clusters of the reference view
// (LabelPropagationQueries), and the mask in another view is the pixels of the clusters there whose
// centroids correspond to them (PropagatedMasks). The protocol "label propagation, pixels" has the
// same queries, and thresholds the pixels of the other view instead of clustering them.

namespace pepeseg {

struct LabelPropagationOptions {
  // Cosine to a centroid of the reference view over which a centroid of another view corresponds
  // to it (pixels: over which a pixel is inside), [-1, 1].
  double min_cosine = 0.7;
  // A cluster belongs to the entity if at least this share of the cluster is inside the reference
  // mask, or if it covers at least this share of the mask. In (0, 1].
  double min_inside = 0.8;
  double min_covered = 0.1;
  // Maximum number of pixels of a view to cluster, 64 to 65536. They are the centres of a regular
  // grid: a smaller entity than a few cells of the grid has no cluster.
  int max_pixels = 16384;
};
// Returns INVALID_ARGUMENT, which names the option, its value and its limits.
absl::Status Validate(const LabelPropagationOptions& options);

// Makes the queries of both protocols: clusters the features of the reference view, gated at a
// scale, and takes the centroids of the clusters that the mask of the prompt (PromptMaskOf) selects
// as positive features. Each reference view is clustered once a scale for all its entities.
// `automatic` has the scale of AutomaticScale. An entity whose mask selects no cluster has a query
// without features. Also calls `check_cancelled` before each clustering. For errors see
// MakeQueries.
absl::StatusOr<std::vector<EntityQueries>> LabelPropagationQueries(
    const QueryTask& query_task, const LabelPropagationOptions& options);

// Returns the clusters that a mask selects, most pixels inside first, the lower one among equals.
// labels: [points] cluster of each point, kNoise for none. inside: [points] non-zero if the point
// is in the mask.
std::vector<int> SelectClusters(const Clusters& clusters, std::span<const uint8_t> inside,
                                const LabelPropagationOptions& options);

// Makes the masks of the queries in the views of a task. Knows a view by its rendered features
// alone: nothing of its truth is read, ignored pixels included.
class PropagatedMasks {
 public:
  // Both must outlive it.
  PropagatedMasks(const QueryTask& query_task, const LabelPropagationOptions& options)
      : query_task_(query_task), options_(options) {}

  // Returns the mask of a query in the view with this index: the pixels whose nearest centroid
  // (NearestCentroids) has a cosine over `min_cosine` to a feature of the query at its scale.
  // query.threshold is not used. Calls `check_cancelled` before a clustering and returns its error.
  absl::StatusOr<BinaryMask> In(size_t view, const Query& query);

 private:
  // Return the centroids of the current view's clusters, [n, 32] and not gated, and the labels that
  // NearestCentroids gives for them. Valid until the next call.
  absl::StatusOr<const std::vector<float>*> CentroidsIn(double scale);
  absl::StatusOr<const std::vector<int32_t>*> LabelsIn(double scale,
                                                       std::span<const float> centroids);

  const QueryTask& query_task_;
  const LabelPropagationOptions& options_;
  // ScoreQueries goes through the views twice. The clusters and labels kept are those of the
  // current view; centroids are also kept for the second time, because HDBSCAN takes most of the
  // time. Both are dropped at a limit.
  size_t view_ = 0;
  std::optional<ViewClusters> clusters_;                               // of view_
  std::map<double, std::vector<int32_t>> labels_;                      // of view_, by scale
  std::map<std::pair<size_t, double>, std::vector<float>> centroids_;  // by view and scale
  size_t num_centroid_values_ = 0;                                     // of centroids_ together
};

}  // namespace pepeseg
