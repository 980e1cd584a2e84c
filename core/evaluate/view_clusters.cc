#include "core/evaluate/view_clusters.h"

#include <algorithm>
#include <utility>

#include "core/base/device_lock.h"
#include "core/base/status_macros.h"
#include "core/evaluate/entity_queries.h"
#include "core/query/resolve_prompt.h"

namespace pepeseg {
namespace {

constexpr HdbscanOptions kHdbscan = {.min_cluster_size = 10, .min_samples = 5};
// Centroids whose similarities to all pixels of a view are in memory together: 64 MiB for a
// megapixel.
constexpr size_t kCentroidsAtOnce = 16;

}  // namespace

absl::StatusOr<ViewClusters> ViewClusters::Sample(const Segmenter& segmenter, const ModelView& view,
                                                  int max_pixels, std::span<const uint8_t> ignore) {
  std::vector<int32_t> grid = GridPixels(view.camera, max_pixels);
  std::erase_if(grid, [&](int32_t pixel) {
    return !ignore.empty() && ignore[static_cast<size_t>(pixel)] != 0;
  });
  ViewClusters clusters(segmenter);
  std::vector<size_t> found;
  ASSIGN_OR_RETURN(clusters.features_, SolidFeatures(segmenter, view, grid, &found));
  for (const size_t i : found) clusters.pixels_.push_back(grid[i]);
  return clusters;
}

absl::StatusOr<const ScaleClusters*> ViewClusters::At(double scale) {
  const auto known = by_scale_.find(scale);
  if (known != by_scale_.end()) return &known->second;
  const std::vector<float> units =
      GatedUnits(features_, segmenter_->model().field.gate, static_cast<float>(scale));
  Backend& backend = segmenter_->backend();
  ASSIGN_OR_RETURN(Clusters clusters, WithDeviceLock(backend, [&] {
                     return Hdbscan(backend, std::span<const float>(units), kHdbscan);
                   }));
  std::vector<float> centroids = CentroidsOf(clusters, scale);
  const auto [made, is_new] =
      by_scale_.emplace(scale, ScaleClusters{std::move(clusters), std::move(centroids)});
  return &made->second;
}

std::vector<float> ViewClusters::CentroidsOf(const Clusters& clusters, double scale) const {
  std::vector<std::vector<float>> members(static_cast<size_t>(clusters.count));  // [.., 32] each
  for (size_t i = 0; i < clusters.labels.size(); ++i) {
    if (clusters.labels[i] == kNoise) continue;
    const auto first = features_.begin() + static_cast<int64_t>(i) * kFeatureSize;
    std::vector<float>& of_cluster = members[static_cast<size_t>(clusters.labels[i])];
    of_cluster.insert(of_cluster.end(), first, first + kFeatureSize);
  }
  std::vector<float> centroids;
  centroids.reserve(members.size() * kFeatureSize);
  for (const std::vector<float>& of_cluster : members) {
    const std::vector<float> mean =
        GatedMean(of_cluster, segmenter_->model().field.gate, static_cast<float>(scale));
    centroids.insert(centroids.end(), mean.begin(), mean.end());
  }
  return centroids;
}

absl::StatusOr<std::vector<int32_t>> NearestCentroids(const Segmenter& segmenter,
                                                      const ModelView& view,
                                                      std::span<const float> centroids,
                                                      double scale) {
  const size_t num_pixels = static_cast<size_t>(view.camera.width) * view.camera.height;
  const size_t num_centroids = centroids.size() / kFeatureSize;
  std::vector<int32_t> nearest(num_pixels, kNoise);
  std::vector<float> best(num_pixels);  // cosine to `nearest`
  for (size_t first = 0; first < num_centroids; first += kCentroidsAtOnce) {
    const size_t count = std::min(kCentroidsAtOnce, num_centroids - first);
    ASSIGN_OR_RETURN(
        const std::vector<float> cosines,
        segmenter.Similarity(centroids.subspan(first * kFeatureSize, count * kFeatureSize), scale,
                             view));
    for (size_t c = 0; c < count; ++c) {
      for (size_t pixel = 0; pixel < num_pixels; ++pixel) {
        const float cosine = cosines[c * num_pixels + pixel];
        if (cosine <= best[pixel]) continue;
        best[pixel] = cosine;
        nearest[pixel] = static_cast<int32_t>(first + c);
      }
    }
  }
  return nearest;
}

}  // namespace pepeseg
