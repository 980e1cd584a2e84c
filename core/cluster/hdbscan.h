#pragma once

#include <span>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/cluster/condensed_tree.h"
#include "kernels/backend.h"

namespace pepeseg {

// Options of HDBSCAN (METHOD.md section 3, "Centroids", and section 4).
struct HdbscanOptions {
  int min_cluster_size = 20;  // minimum number of points of a cluster; at least 2
  // The core distance of a point is its distance to the min_samples-th nearest point, itself being
  // the first. 1..kMaxMinSamples.
  int min_samples = 5;
};
// Returns INVALID_ARGUMENT, naming the field, if an option is out of range.
absl::Status Validate(const HdbscanOptions& options);

// Clusters points of 32 numbers, [n, 32], under the Euclidean distance. Exact. The device computes
// the spanning tree, the host the clusters. If there are fewer points than min_cluster_size or
// min_samples, all are noise; a point with a value that is not finite is noise. INVALID_ARGUMENT:
// an option is out of range, or the number of values is not a multiple of 32. RESOURCE_EXHAUSTED or
// INTERNAL: the device failed, see TakeStatus. The caller must have exclusive use of the device.
//
// points: in backend memory.
absl::StatusOr<Clusters> Hdbscan(Backend& backend, DeviceSpan<const float> points,
                                 const HdbscanOptions& options);
// The same for points in host memory.
absl::StatusOr<Clusters> Hdbscan(Backend& backend, std::span<const float> points,
                                 const HdbscanOptions& options);

// Returns the mean of each cluster's points, scaled to length 1: [count, 32]. A mean is 0 where the
// points cancel out. points: [n, 32], as clustered.
std::vector<float> ClusterMeans(std::span<const float> points, const Clusters& clusters);

}  // namespace pepeseg
