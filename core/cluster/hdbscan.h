#pragma once

#include <span>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/cluster/condensed_tree.h"
#include "kernels/backend.h"

namespace pepeseg {

// HDBSCAN of points of 32 numbers under the Euclidean distance (METHOD.md sections 3 and 4).
struct HdbscanOptions {
  int min_cluster_size = 20;  // points, at least 2
  // 1..kMaxMinSamples: a point's core distance is that to its min_samples-th nearest, itself
  // counted.
  int min_samples = 5;
};
absl::Status Validate(const HdbscanOptions& options);

// Exact. Fewer points than min_cluster_size or min_samples are all noise, and so is a row that
// holds a NaN. The device works on the distances, the host on the tree. INVALID_ARGUMENT for bad
// options or a number of values that is no multiple of 32.
absl::StatusOr<Clusters> Hdbscan(Backend& backend, DeviceSpan<const float> points,  // [n, 32]
                                 const HdbscanOptions& options);
absl::StatusOr<Clusters> Hdbscan(Backend& backend, std::span<const float> points,
                                 const HdbscanOptions& options);

// The mean of each cluster's points, scaled to length 1: [count, 32]. 0 where the points cancel
// out.
std::vector<float> ClusterMeans(std::span<const float> points, const Clusters& clusters);

}  // namespace pepeseg
