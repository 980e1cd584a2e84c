#pragma once

#include <span>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/cluster/hdbscan.h"
#include "core/evaluate/entity_queries.h"
#include "core/evaluate/evaluation_task.h"
#include "core/query/segmenter.h"

namespace pepeseg {

// Protocol "label propagation", of SPIn-NeRF and LERF-Mask (METHOD.md section 5).
struct LabelPropagationOptions {
  double min_cosine = 0.7;  // cosine to a centroid from which a pixel is inside, [-1, 1]
  // A cluster belongs to the entity if at least this share of the cluster is inside the reference
  // mask, or if it covers at least this share of the mask. In (0, 1].
  double min_inside = 0.8;
  double min_covered = 0.1;
  // Maximum number of pixels of the reference view to cluster, 64 to 65536. They are the centres of
  // a regular grid: a smaller entity than a few cells of the grid has no cluster.
  int max_pixels = 16384;
};
// Returns INVALID_ARGUMENT, which names the option, its value and its limits.
absl::Status Validate(const LabelPropagationOptions& options);

// Makes the queries of protocol "label propagation": clusters the features of the reference view,
// gated at a scale, by HDBSCAN, and takes the centroids of the clusters that the mask of the prompt
// (PromptMaskOf) selects as positive features. Each reference view is clustered once a scale for
// all its entities. `automatic` has the scale of AutomaticScale. An entity whose mask selects no
// cluster has a query without features. Also calls `check_cancelled` before each clustering. For
// errors see MakeQueries.
absl::StatusOr<std::vector<EntityQueries>> LabelPropagationQueries(
    const QueryTask& query_task, const LabelPropagationOptions& options);

// Returns the clusters that a mask selects, most pixels inside first, the lower one among equals.
// labels: [points] cluster of each point, kNoise for none. inside: [points] non-zero if the point
// is in the mask.
std::vector<int> SelectClusters(const Clusters& clusters, std::span<const uint8_t> inside,
                                const LabelPropagationOptions& options);

}  // namespace pepeseg
