#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "core/scene/capture.h"
#include "core/scene/model.h"
#include "kernels/backend.h"

namespace pepeseg {

// What a view falls into at one scale.
struct ClusterSizes {
  double scale = 0;         // quantile
  double num_clusters = 0;  // mean over the held-out views
  double mean_pixels = 0;   // of a cluster, of the pixels of the grid, as pixels of the view
  double noise_share = 0;   // pixels in no cluster
};

// HDBSCAN (min_cluster_size 20, min_samples 5) of the gated features of a grid of at most 16,384
// pixels of each held-out view.
absl::StatusOr<std::vector<ClusterSizes>> MeasureGranularity(Backend& backend,
                                                             const Capture& capture,
                                                             const Model& model,
                                                             const std::vector<double>& scales);

}  // namespace pepeseg
