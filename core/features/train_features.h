#pragma once

#include <cstdint>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/base/progress.h"
#include "core/scene/capture.h"
#include "core/scene/gaussians.h"
#include "core/scene/model.h"
#include "kernels/backend.h"

namespace pepeseg {

// How scene units become the query scale in [0, 1].
enum class ScaleMapping {
  kQuantiles = 1,  // the share of the masks that are smaller
  kEven = 2,       // linearly, from the smallest mask to the largest but for the last percent
};

// What a difference of depth or colour between two pixels is measured against.
enum class PerceptionThreshold {
  kDifferences = 1,  // between each of them and the pixels about it
  kGradients = 2,    // between neighbours about each of them
};

// Stage two (METHOD.md sections 2 and 3): geometry frozen; a feature per Gaussian and the scale
// gate from the scale-aware loss, the perception loss and the centroid loss on sparse rows, and the
// norms of pixels and Gaussians.
struct FeatureOptions {
  int num_steps = 10000;  // one view each
  int num_pixels = 1000;  // samples a step, each under a mask that has a scale
  // The share of them drawn mask by mask, each as likely as any other: so that small parts are
  // seen, too. The rest is drawn pixel by pixel (METHOD.md section 3 draws all so).
  double mask_share = 0.25;  // [0, 1]
  // Further samples of what no mask covers in any view, as one thing apart from all others.
  int num_background_pixels = 200;
  int num_scales = 10;  // a step, 1..kMaxScales; two of them beyond the masks' own
  // During this share of the steps the largest masks give no scales: those of the finest 30 % of a
  // view's masks are drawn first, then those of ever larger ones. Things that touch must come apart
  // before they are pulled together at a larger scale: the gradient that separates two features is
  // zero where they are equal. 0: all scales from the first step (METHOD.md section 3).
  // tests/bench/results/fine_first.md.
  double fine_first = 0.3;  // [0, 0.9]
  ScaleMapping scale_mapping = ScaleMapping::kQuantiles;
  float learning_rate = 1e-2f;  // of Adam, at the start; falls exponentially to
  float learning_rate_final = 1e-4f;
  // A feature is smoothed over the nearest Gaussians, itself among them: over some of them, drawn
  // anew each step, in training, and over all in the model.
  int num_neighbors = 4;        // 1..kMaxNeighbors
  int num_drawn_neighbors = 2;  // 1..num_neighbors
  // The centroid loss, from this share of the steps on: every so many steps up to so many masked
  // pixels of a view are clustered at scale 1 (upper) and 0.01 (lower). Weight 0: left out.
  double centroid_from = 0.7;  // [0, 1]
  int centroid_every = 200;
  int centroid_pixels = 16'384;
  float centroid_weight_upper = 1.0f;
  // Off: worth nothing measurable on desk, and it loses where many small parts touch
  // (tests/bench/results/h200_segmentation.md).
  float centroid_weight_lower = 0;
  // The perception loss, for pixels that no mask of their view covers. Weight 0: left out, as where
  // no view has a depth prior, or every pixel is covered or background.
  float perception_weight = 0.2f;
  int num_perception_pixels = 128;  // further samples a step
  PerceptionThreshold perception_threshold = PerceptionThreshold::kDifferences;
  bool perception_cross_view = true;  // whether other views' masks overrule what it sees
  // A mask that at least three near views see, and whose mean IoU with their masks is less than
  // this, stands alone and is not trained on. 0: all are. See MaskAgreement.
  // Off: it loses (tests/bench/results/mask_agreement.md).
  double min_mask_agreement = 0;  // [0, 1]
  // Whether a view gets the masks that it lacks and the near views agree on, see CompleteMasks.
  // Only where the MaskQuality of the capture is under kCompleteBelow: there is little to add to
  // masks that agree.
  bool complete_masks = true;
  // Samples drawn ahead: each view is rasterised once a chunk, and the chunk's rows are kept, 1 to
  // 3 MB a step.
  int steps_per_chunk = 750;
  // When the loss has fallen by less than this share of itself over a round of at least 500 steps,
  // the rest of the schedule is done in closing_share of the steps, the learning rate falling the
  // faster. 0: never.
  double min_loss_fall = 0.01;
  double closing_share = 0.5;
  // In so many training views, and a sixth of them, a Gaussian must show for its feature to count
  // in full where features are blended, see FeatureConfidence. 0: all count alike.
  int sure_views = 8;
  // A step moves only the Gaussians that its samples see; what the moments of the others would have
  // done is made up for when they are next seen. False: it moves all of them, for nothing but to
  // measure what that saves.
  bool only_seen_gaussians = true;
  uint64_t seed = 1;
};
absl::Status Validate(const FeatureOptions& options);

// Steps whose losses may stay on the device before the host waits for them.
inline constexpr int kMaxUnreadFeatureSteps = 64;

// FAILED_PRECONDITION when no training view has a mask with a scale.
absl::StatusOr<FeatureField> TrainFeatures(Backend& backend, const Capture& capture,
                                           const Gaussians& gaussians,
                                           const FeatureOptions& options, ProgressFn progress);

}  // namespace pepeseg
