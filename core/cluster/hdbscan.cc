#include "core/cluster/hdbscan.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numeric>

#include "absl/strings/str_cat.h"
#include "core/base/device_lock.h"
#include "core/base/errors.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

// The definition at ClustersOf removes edges from the longest to the shortest. Here the tree is
// built the other way round, because that takes a union-find only: edges are added from the
// shortest to the longest, and components of points merge as the distance grows and lambda falls. A
// cluster is therefore created at the lambda where it ends by the definition, and gets its parent
// at the lambda where it begins.

constexpr int kNone = -1;

struct Cluster {
  int parent = kNone;    // has a higher index; kNone: the root
  double deepest = 0;    // lambda at which it ends by the definition
  double stability = 0;  // before it has a parent: the sum of the lambdas at which its points leave
};

// The tree of the clusters of at least min_cluster_size points.
class CondensedTree {
 public:
  CondensedTree(std::span<const TreeEdge> edges, int min_cluster_size);

  // Returns for each cluster the chosen cluster that holds it, itself or one above it, or kNone.
  std::vector<int> Choose() const;

  const std::vector<Cluster>& clusters() const { return clusters_; }
  // Returns the smallest cluster that a point is in, or kNone, and the lambda at which it leaves
  // it.
  int cluster_of(int point) const { return point_cluster_[point]; }
  double lambda_of(int point) const { return point_lambda_[point]; }

 private:
  // A node of the union-find, by point. All but `parent` and `next` are read at roots only.
  struct Component {
    int parent;
    int size = 1;
    int cluster = kNone;  // kNone while the size is under min_cluster_size
    // The points of a component without a cluster, as a linked list that begins at the root.
    int last, next = kNone;
  };

  int RootOf(int point);
  // Adds all edges of one length.
  void MergeLevel(std::span<const TreeEdge> edges);
  // Joins components to one. parts: their roots, the root of the joined component first.
  void Join(std::span<const int> parts, double lambda);
  // Puts the points of a component without a cluster into a cluster, which they leave at `lambda`.
  void Give(int component, int cluster, double lambda);

  int min_cluster_size_;
  std::vector<Component> components_;  // [points]
  std::vector<Cluster> clusters_;      // children before their parents
  std::vector<int> point_cluster_;     // [points] see cluster_of
  std::vector<double> point_lambda_;   // [points] see lambda_of
};

CondensedTree::CondensedTree(std::span<const TreeEdge> edges, int min_cluster_size)
    : min_cluster_size_(min_cluster_size),
      components_(edges.size() + 1),
      point_cluster_(components_.size(), kNone),
      point_lambda_(components_.size()) {
  for (size_t i = 0; i < components_.size(); ++i) {
    components_[i].parent = components_[i].last = static_cast<int>(i);
  }
  for (size_t first = 0, end = 0; first < edges.size(); first = end) {
    while (end < edges.size() && edges[end].squared == edges[first].squared) ++end;
    MergeLevel(edges.subspan(first, end - first));
  }
}

// Halves the path on the way.
int CondensedTree::RootOf(int point) {
  while (components_[point].parent != point) {
    point = components_[point].parent = components_[components_[point].parent].parent;
  }
  return point;
}

// Edges of one length may connect components in a chain. So the union-find is updated first, then
// each group of connected components is joined as a whole, as the definition requires.
void CondensedTree::MergeLevel(std::span<const TreeEdge> edges) {
  std::vector<int> parts;
  for (const TreeEdge& edge : edges) {
    parts.push_back(RootOf(edge.a));
    parts.push_back(RootOf(edge.b));
  }
  std::sort(parts.begin(), parts.end());
  parts.erase(std::unique(parts.begin(), parts.end()), parts.end());
  for (const TreeEdge& edge : edges) {
    const int a = RootOf(edge.a), b = RootOf(edge.b);
    // The root of the larger component stays the root, so that paths stay short.
    if (components_[a].size < components_[b].size) {
      components_[a].parent = b;
    } else {
      components_[b].parent = a;
    }
  }
  std::vector<std::pair<int, int>> grouped;  // root, part
  grouped.reserve(parts.size());
  for (const int part : parts) grouped.emplace_back(RootOf(part), part);
  std::sort(grouped.begin(), grouped.end());
  const double lambda = 1 / std::sqrt(static_cast<double>(edges[0].squared));
  for (size_t i = 0; i < grouped.size();) {
    const int root = grouped[i].first;
    parts.assign(1, root);
    for (; i < grouped.size() && grouped[i].first == root; ++i) {
      if (grouped[i].second != root) parts.push_back(grouped[i].second);
    }
    Join(parts, lambda);
  }
}

// Parts with a cluster are large. If exactly one is, its cluster continues, and the points of the
// other parts leave it here. Otherwise a new cluster begins to exist, if the joined component is
// large enough: it ends here by the definition, and the clusters of the large parts are its
// children.
void CondensedTree::Join(std::span<const int> parts, double lambda) {
  int size = 0, num_large = 0, cluster = kNone;
  for (const int part : parts) {
    size += components_[part].size;
    if (components_[part].cluster == kNone) continue;
    ++num_large;
    cluster = components_[part].cluster;
  }
  if (num_large != 1 && size >= min_cluster_size_) {
    cluster = static_cast<int>(clusters_.size());
    clusters_.push_back({kNone, lambda, 0});
  }
  Component& root = components_[parts[0]];
  for (const int part : parts) {
    Component& component = components_[part];
    if (component.cluster == kNone && cluster != kNone) {
      Give(part, cluster, lambda);
    } else if (component.cluster != cluster) {
      // All points that are left in the child leave the parent here, where the child begins.
      Cluster& child = clusters_[component.cluster];
      child.parent = cluster;
      child.stability -= component.size * lambda;
      clusters_[cluster].stability += component.size * lambda;
    } else if (cluster == kNone && part != parts[0]) {
      components_[root.last].next = part;
      root.last = component.last;
    }
  }
  root.size = size;
  root.cluster = cluster;
}

void CondensedTree::Give(int component, int cluster, double lambda) {
  clusters_[cluster].stability += components_[component].size * lambda;
  for (int point = component; point != kNone; point = components_[point].next) {
    point_cluster_[point] = cluster;
    point_lambda_[point] = lambda;
  }
}

std::vector<int> CondensedTree::Choose() const {
  const int count = static_cast<int>(clusters_.size());
  std::vector<double> below(count, 0);  // sum of the stabilities of the best choice below
  std::vector<int> chosen(count, kNone);
  // Children come before their parents; the last cluster is the root, which is not a candidate.
  for (int i = 0; i + 1 < count; ++i) {
    const Cluster& cluster = clusters_[i];
    if (below[i] <= cluster.stability) chosen[i] = i;
    below[cluster.parent] += std::max(below[i], cluster.stability);
  }
  // A chosen cluster overrules the choices below it.
  for (int i = count - 2; i >= 0; --i) {
    const int above = chosen[clusters_[i].parent];
    if (above != kNone) chosen[i] = above;
  }
  return chosen;
}

// Returns the strength of a point that leaves a cluster at `lambda`. Both lambdas may be infinite.
float Strength(double lambda, double deepest) {
  if (std::isinf(lambda) || lambda >= deepest) return 1;
  return static_cast<float>(lambda / deepest);
}

}  // namespace

absl::Status Validate(const HdbscanOptions& options) {
  if (options.min_cluster_size < 2) {
    return absl::InvalidArgumentError(
        absl::StrCat("min_cluster_size is ", options.min_cluster_size, ", must be at least 2"));
  }
  return CheckInRange("min_samples", options.min_samples, 1, kMaxMinSamples);
}

absl::StatusOr<Clusters> Hdbscan(Backend& backend, DeviceSpan<const float> points,
                                 const HdbscanOptions& options) {
  RETURN_IF_ERROR(Validate(options));
  if (points.size % kFeatureSize != 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("points have ", points.size, " values, must be a multiple of ", kFeatureSize));
  }
  const int64_t num_points = points.size / kFeatureSize;
  if (num_points == 0) return Clusters();
  Buffer<float> core(backend, num_points);
  Buffer<TreeEdge> edges(backend, num_points - 1);
  backend.SpanningTree({points, options.min_samples, core.span(), edges.span()});
  std::vector<TreeEdge> host_edges(num_points - 1);
  edges.Download(std::span<TreeEdge>(host_edges));
  RETURN_IF_ERROR(TakeStatus(backend));
  return ClustersOf(host_edges, options.min_cluster_size);
}

absl::StatusOr<Clusters> Hdbscan(Backend& backend, std::span<const float> points,
                                 const HdbscanOptions& options) {
  const Buffer<float> uploaded(backend, points);
  return Hdbscan(backend, uploaded.span(), options);
}

std::vector<float> ClusterMeans(std::span<const float> points, const Clusters& clusters) {
  // The length of a mean is normalised, so the number of points is not needed.
  std::vector<double> sums(static_cast<size_t>(clusters.count) * kFeatureSize);
  for (size_t point = 0; point < clusters.labels.size(); ++point) {
    const int label = clusters.labels[point];
    if (label == kNoise) continue;
    for (int k = 0; k < kFeatureSize; ++k) {
      sums[label * kFeatureSize + k] += static_cast<double>(points[point * kFeatureSize + k]);
    }
  }
  std::vector<float> means(sums.size());
  for (size_t first = 0; first < sums.size(); first += kFeatureSize) {
    double squares = 0;
    for (int k = 0; k < kFeatureSize; ++k) squares += sums[first + k] * sums[first + k];
    const double scale = squares > 0 ? 1 / std::sqrt(squares) : 0;
    for (int k = 0; k < kFeatureSize; ++k) {
      means[first + k] = static_cast<float>(scale * sums[first + k]);
    }
  }
  return means;
}

Clusters ClustersOf(std::span<const TreeEdge> edges, int min_cluster_size) {
  const CondensedTree tree(edges, min_cluster_size);
  const std::vector<int> chosen = tree.Choose();
  const int num_points = static_cast<int>(edges.size()) + 1;
  Clusters clusters;
  clusters.labels.assign(num_points, kNoise);
  clusters.strengths.assign(num_points, 0);
  std::vector<int> label_of(chosen.size(), kNone);
  for (int point = 0; point < num_points; ++point) {
    const int left = tree.cluster_of(point);
    const int cluster = left == kNone ? kNone : chosen[left];
    if (cluster == kNone) continue;
    if (label_of[cluster] == kNone) label_of[cluster] = clusters.count++;
    clusters.labels[point] = label_of[cluster];
    clusters.strengths[point] = Strength(tree.lambda_of(point), tree.clusters()[cluster].deepest);
  }
  return clusters;
}

}  // namespace pepeseg
