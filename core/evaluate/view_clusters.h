#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/cluster/hdbscan.h"
#include "core/query/segmenter.h"

namespace pepeseg {

// The clusters of a sample of a view's pixels at one scale.
struct ScaleClusters {
  Clusters clusters;
  // [clusters.count, 32], not gated: GatedMean of each cluster's pixels.
  std::vector<float> centroids;
};

// Clusters the rendered features of a view, gated at a scale, by HDBSCAN with at least 10 pixels a
// cluster and 5 samples. Clusters a sample of the pixels, because HDBSCAN's time grows with the
// square of their number. Keeps the clusters of every scale asked for. For one thread at a time.
class ViewClusters {
 public:
  // Samples the pixels at the centres of a regular grid of about `max_pixels` cells that show
  // something with a feature (SolidFeatures). ignore: [height, width], non-zero pixels are left
  // out; empty: none is. Errors are those of Segmenter::PixelFeatures. The segmenter must outlive
  // it.
  static absl::StatusOr<ViewClusters> Sample(const Segmenter& segmenter, const ModelView& view,
                                             int max_pixels, std::span<const uint8_t> ignore = {});

  // Returns the sampled pixels, y * width + x, ascending.
  std::span<const int32_t> pixels() const { return pixels_; }

  // Returns the clusters of pixels() at a quantile scale. Waits for the device lock; errors are
  // those of Hdbscan. The pointer stays valid for the life of the object.
  absl::StatusOr<const ScaleClusters*> At(double scale);

 private:
  explicit ViewClusters(const Segmenter& segmenter) : segmenter_(&segmenter) {}

  // Returns the centroids of clusters of pixels_, see ScaleClusters.
  std::vector<float> CentroidsOf(const Clusters& clusters, double scale) const;

  const Segmenter* segmenter_;
  std::vector<int32_t> pixels_;
  std::vector<float> features_;               // [pixels_, 32] as rendered, not gated
  std::map<double, ScaleClusters> by_scale_;  // of pixels_
};

// Returns the cluster of each pixel of a view: the index of the centroid with the largest cosine to
// the pixel's feature at a quantile scale, the first among equals, or kNoise where no cosine is
// over 0 or nothing with a feature is rendered (kMinPixelNorm). [height, width].
// centroids: [n, 32], not gated. Errors are those of Segmenter::Similarity.
absl::StatusOr<std::vector<int32_t>> NearestCentroids(const Segmenter& segmenter,
                                                      const ModelView& view,
                                                      std::span<const float> centroids,
                                                      double scale);

}  // namespace pepeseg
