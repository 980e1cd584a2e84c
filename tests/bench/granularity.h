#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "core/scene/capture.h"
#include "core/scene/model.h"
#include "kernels/backend.h"

namespace pepeseg {

// The clusters of a view at one scale.
struct ClusterSizes {
  double scale = 0;         // quantile
  double num_clusters = 0;  // mean over the held-out views
  double mean_pixels = 0;   // mean size of a cluster, pixels of the view
  double noise_share = 0;   // share of pixels in no cluster
};

// Clusters the gated features of each held-out view, on a grid of at most 16,384 pixels, with
// HDBSCAN (min_cluster_size 20, min_samples 5).
absl::StatusOr<std::vector<ClusterSizes>> MeasureGranularity(Backend& backend,
                                                             const Capture& capture,
                                                             const Model& model,
                                                             const std::vector<double>& scales);

}  // namespace pepeseg
