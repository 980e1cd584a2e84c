#include "core/cluster/hdbscan.h"

#include <array>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "core/base/backend_turn.h"
#include "core/base/range_check.h"
#include "core/base/status_macros.h"

namespace pepeseg {

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

}  // namespace pepeseg
