#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "absl/status/statusor.h"
#include "core/base/progress.h"
#include "core/features/batch_drawer.h"
#include "core/features/near_views.h"
#include "core/features/options.h"
#include "core/features/perception_cues.h"
#include "core/render/renderer.h"
#include "core/scene/capture.h"
#include "core/scene/gaussians.h"
#include "core/scene/model.h"
#include "kernels/ops/smooth.h"

namespace pepeseg {

// The inputs of stage two, computed before its first step and constant while it trains. The views
// and the cues refer to other members; moving the whole keeps them valid.
struct PreparedFeatures {
  const Capture& capture;
  std::unique_ptr<Renderer> scene = {};       // of the Gaussians
  std::vector<MaskSet> completed_masks = {};  // by view of the capture; empty: no mask was added
  std::optional<double> mask_quality = {};    // see MaskQuality
  std::vector<DrawableView> views = {};       // at least one
  FeatureField field = {};                    // scale_quantiles and confidence alone
  Buffer<int32_t> neighbors = {};             // see NeighborGraph
  int num_neighbors = 1;
  std::unique_ptr<Reprojection> reprojection = {};
  // Null if the perception loss is left out.
  std::unique_ptr<CrossView> cross_view = {};
  std::unique_ptr<PerceptionCues> cues = {};
  std::vector<SkippedPart> skipped = {};  // parts of the loss that are left out

  NeighborGraph graph() const { return {neighbors.span(), num_neighbors}; }
};

// Measures, compares and completes the masks of the capture (METHOD.md section 2), and lists what
// stage two samples from. The backend and the capture must outlive the result. FAILED_PRECONDITION:
// no training view has a mask with a scale.
absl::StatusOr<PreparedFeatures> PrepareFeatures(Backend& backend, const Capture& capture,
                                                 const Gaussians& gaussians,
                                                 const FeatureOptions& options);

// Returns the number of views whose rendered depths PrepareFeatures keeps on the host while it
// renders the depths of the next ones. num_pixels: of the largest view.
size_t ViewsInDepthBlock(int64_t num_pixels);

// Returns the num_neighbors Gaussians whose means are nearest to that of each Gaussian, itself
// first, then by distance: [count, num_neighbors], for NeighborGraph (METHOD.md section 3,
// "Smoothing"). If there are fewer Gaussians, the last columns hold the Gaussian itself.
// num_neighbors: 1..kMaxNeighbors.
//
// The search is exact. Which of several Gaussians at equal distance is taken is unspecified, but
// the same in each run. Uses all cores of the machine.
std::vector<int32_t> NearestNeighbors(const Gaussians& gaussians, int num_neighbors);

}  // namespace pepeseg
