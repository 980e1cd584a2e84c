#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "absl/status/statusor.h"
#include "core/base/progress.h"
#include "core/features/batch_drawer.h"
#include "core/features/cross_view.h"
#include "core/features/perception_cues.h"
#include "core/features/reprojection.h"
#include "core/features/train_features.h"
#include "core/render/frozen_scene.h"
#include "core/scene/capture.h"
#include "core/scene/gaussians.h"

namespace pepeseg {

// What stage two knows before its first step.
struct PreparedFeatures {
  std::vector<MaskSet> completed_masks;  // by view of the capture; empty where none was added
  std::optional<double> mask_quality;    // see MaskQuality
  std::vector<DrawableView> views;
  std::vector<float> scale_quantiles;  // of the field, as the next
  std::vector<float> confidence;       // none where all count alike
  std::vector<int32_t> neighbors;      // of the graph
  std::vector<float> features;         // to begin with
  std::unique_ptr<Reprojection> reprojection;
  // Null where the perception loss is left out. Both look at the reprojection.
  std::unique_ptr<CrossView> cross_view;
  std::unique_ptr<PerceptionCues> cues;
  std::vector<SkippedTerm> skipped;
};

// The capture must outlive what comes out. FAILED_PRECONDITION: no training view has a mask with a
// scale.
absl::StatusOr<PreparedFeatures> PrepareFeatures(const Capture& capture, const Gaussians& gaussians,
                                                 FrozenScene& scene, const FeatureOptions& options);

}  // namespace pepeseg
