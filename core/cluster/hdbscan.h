#pragma once

#include <span>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "kernels/backend.h"
#include "kernels/ops/cluster.h"

namespace pepeseg {

inline constexpr int kNoise = -1;  // label of points in no cluster

// A flat clustering.
struct Clusters {
  int count = 0;
  // [points] 0..count - 1, or kNoise. Clusters are numbered in the order of their first points.
  std::vector<int> labels;
  // [points] 1 where a cluster is densest, smaller further out, 0 for noise.
  std::vector<float> strengths;
};

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

// Returns the flat clusters of HDBSCAN (Campello, Moulavi and Sander 2013) from a minimum spanning
// tree of n points under mutual reachability. edges: [n - 1], ascending, n >= 1.
//
// Edges are removed from the longest to the shortest. The density at a distance d is
// lambda = 1 / d.
// - All edges of one length are removed at once, as in the paper. So the clusters depend neither
//   on which of several minimum spanning trees is given nor on the order of the points.
//   Implementations that remove edges one by one let the order of equal edges decide on which side
//   a point between two clusters falls.
// - Where a cluster falls apart, parts of fewer than min_cluster_size points become noise. If one
//   larger part remains, the cluster continues as that part; if none or several remain, it ends.
// - The stability of a cluster is the sum over its points of
//   lambda(the point leaves it) - lambda(the cluster begins). It is infinite if at least
//   min_cluster_size points have a mutual reachability of 0.
// - Clusters are chosen from the leaves up. A cluster replaces the clusters chosen below it if it
//   is at least as stable as their sum. The root, which is all points, is never chosen.
Clusters ClustersOf(std::span<const TreeEdge> edges, int min_cluster_size);

}  // namespace pepeseg
