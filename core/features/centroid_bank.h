#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "core/cluster/hdbscan.h"
#include "core/scene/mask_set.h"

// From the clusters of a view's pixels to the centroids of the centroid loss (METHOD.md section 3,
// "Centroids"): which clusters count, and how their means are kept from view to view.

namespace pepeseg {

// Share of a cluster's labelled pixels that one mask must hold for the cluster to be kept.
inline constexpr double kMinAgreement = 0.7;

// Returns the clusters of a view's pixels without those that its masks tell apart: a cluster is
// dropped if no mask holds kMinAgreement of its pixels that have a label at `scale` (see
// ScaleLabels). Otherwise the centroid loss would pull together for good what the features still
// confuse. A cluster without a labelled pixel is kept. Pixels of dropped clusters become noise, the
// remaining clusters keep their order.
//
// pixels: y * width + x of each cluster label. mask_scales: [num_masks] scene units. scale: scene
// units.
Clusters KeepAgreeing(const Clusters& clusters, const MaskSet& masks,
                      std::span<const int32_t> pixels, std::span<const float> mask_scales,
                      float scale);

// The directions of the gated features of the clusters seen so far, at one scale.
class CentroidBank {
 public:
  // merge_cosine: a cluster whose mean has a larger cosine with a centroid is that centroid again.
  explicit CentroidBank(float merge_cosine) : merge_cosine_(merge_cosine) {}

  // Replaces the centroids, [K, 32].
  void Set(std::vector<float> centroids) { centroids_ = std::move(centroids); }

  // Adds the means of the clusters of one view, [count, 32] of length 1. A mean that matches a
  // centroid moves the nearest one by a tenth of the way, others become new centroids. Means of the
  // same call are never merged with each other: HDBSCAN has found them to be apart.
  void Merge(std::span<const float> means);

  // [K, 32] of length 1.
  const std::vector<float>& centroids() const { return centroids_; }

 private:
  float merge_cosine_;
  std::vector<float> centroids_;
};

}  // namespace pepeseg
