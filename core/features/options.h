#pragma once

#include <cstdint>

#include "absl/status/status.h"

namespace pepeseg {

// How a scale in scene units becomes the query scale in [0, 1].
enum class ScaleMapping {
  kQuantiles = 1,  // the share of the masks that are smaller
  kEven = 2,       // linear from the smallest mask to the 99th percentile, see EvenScales
  kMinMax = 3,     // linear from the smallest mask to the largest, as the paper prints it
};

// What the perception loss compares a difference of depth or colour between two pixels with.
enum class PerceptionThreshold {
  kDifferences = 1,  // differences between each of the two and the pixels around it
  kGradients = 2,    // differences between adjacent pixels around each of the two, sampled
  kWindows = 3,      // the gradients of all pixels in the window around each of the two, as printed
};

// Options of stage two (METHOD.md sections 2 and 3), which trains a feature for each Gaussian and
// the scale gate, with frozen geometry.
struct FeatureOptions {
  int num_steps = 10000;  // one view each; [1, 10,000,000]
  int num_pixels = 1000;  // samples of a step under masks that have a scale; [2, 16,384]
  // Share of these samples that are drawn mask by mask, all masks equally likely, so that small
  // parts are seen. The rest is drawn pixel by pixel, as in the paper. [0, 1].
  double mask_share = 0.25;
  // Additional samples of a step that no mask covers in any view. They count as one object of their
  // own, apart from all others. 0: none; [0, 16,384].
  int num_background_pixels = 200;
  int num_scales = 10;  // of a step; two are not from random masks, see BatchDrawer; 1..kMaxScales
  // Share of the steps in which the largest masks give no scales: scales come from the finest 30 %
  // of a view's masks first, then from more and more of them. Objects that touch must come apart
  // before larger masks pull them together, because the gradient that separates two features is
  // zero where they are equal. 0: all scales from the first step, as in the paper. [0, 0.9].
  // tests/bench/results/fine_first.md.
  double fine_first = 0.3;
  // Cosine up to which two pixels that belong apart are left alone. Only 32 features can be
  // orthogonal to each other; with a margin there is room for many more things. [0, 0.9]. 0: as in
  // the paper. tests/bench/results/margin.md.
  float negative_margin = 0.2f;
  // Cosine under which a pair that belongs together counts in every step, however many such pairs
  // there are; the others are drawn. [-1, 1]. -1: no pair counts for its cosine, as in the paper.
  // SAGA's code has 0.75. tests/bench/results/margin.md.
  float min_positive_cosine = 0.9f;
  // The same for a pair that belongs apart: the cosine over which it counts. [-1, 1]. 1: none does,
  // as in the paper. SAGA's code has 0.5.
  float max_negative_cosine = 0.5f;
  // Whether the contrastive loss is one mean over all pairs, drawn alike, as in the paper. False: a
  // mean of the pairs that belong together plus a mean of the others, drawn in equal numbers.
  bool joint_pair_mean = false;
  // Alpha over which a pixel counts in the norm loss. [0, 1]. 0: all pixels that show anything, as
  // in the paper.
  float min_norm_alpha = 0.9f;
  ScaleMapping scale_mapping = ScaleMapping::kQuantiles;
  // Learning rate of Adam at the start and at the end; it falls exponentially. [1e-8, 1].
  float learning_rate = 1e-2f;
  float learning_rate_final = 1e-4f;
  // Layers of the scale gate: 1 or 2 (kernels/math/gate.h). The paper has 2.
  int gate_layers = 1;
  // Number of nearest Gaussians, itself included, over which a feature is smoothed, and number of
  // them that each training step draws.
  int num_neighbors = 4;        // 1..kMaxNeighbors
  int num_drawn_neighbors = 2;  // 1..num_neighbors
  // Share of the steps in which features are smoothed. From then on each Gaussian learns its own,
  // beginning with what smoothing gave, which makes borders sharper. 0: no smoothing; [0, 1].
  // 1: to the end and in the model, as in SAGA and the paper. tests/bench/results/smoothing.md.
  double smooth_until = 0.5;
  // The centroid loss starts at this share of the steps. Every `centroid_every` steps (T of the
  // paper), up to `centroid_pixels` pixels of each of `centroid_views` random views are clustered
  // at scale 1 (upper, U) and 0.01 (lower, L).
  double centroid_from = 0.7;    // [0, 1]
  int centroid_every = 200;      // steps; [1, 10,000,000]
  int centroid_pixels = 16'384;  // [1, 65,536]
  int centroid_views = 1;        // [1, 1000]
  // Whether only pixels under masks are clustered. False: pixels of the whole map, as in the paper.
  bool centroid_masked_only = true;
  // Weights of the centroid loss at either scale. 0: left out; [0, 100]. The paper has 0.3 (upper)
  // and 0.1 (lower). The lower scale is off: on desk it gains nothing measurable, and it loses
  // where many small parts touch (tests/bench/results/h200_segmentation.md).
  float centroid_weight_upper = 1.0f;
  float centroid_weight_lower = 0;
  // tau of the paper at either scale: a pixel is pulled to the nearest centroid if its cosine with
  // it is larger. [0, 0.9999]. At the lower scale the 0.9 of the paper pulls touching parts
  // together.
  float centroid_cosine_upper = 0.9f;
  float centroid_cosine_lower = 0.97f;
  // The mean of a cluster is merged into the nearest centroid if its cosine with it is larger. [0,
  // 0.9999]. The paper has 0.9 at both scales.
  float centroid_merge_upper = 0.9f;
  float centroid_merge_lower = 0.95f;
  bool centroid_check_masks = true;  // drops clusters that masks separate, see KeepAgreeing
  // Weight of the perception loss, for pixels that no mask of their view covers. It is left out if
  // the weight is 0, if no training view has a depth prior, or if all pixels are covered or
  // background. [0, 100]. The paper has 0.2.
  float perception_weight = 0.2f;
  int num_perception_pixels = 128;  // additional samples of a step; [1, 16,384]
  PerceptionThreshold perception_threshold = PerceptionThreshold::kDifferences;
  bool perception_cross_view = true;  // masks of other views overrule depth and colour
  // Whether r(s) follows the sizes of image and masks. False: min(H, W) (0.03 + 0.12 s), in [20,
  // 200] pixels. Both are ours: the paper says only that r(s) grows with the scale.
  bool perception_fit_window = true;
  // Whether a pair has a pixel that no mask covers. False: pairs of covered pixels count as well,
  // where the masks agree with depth and colour. The paper leaves those out.
  bool perception_unlabelled_only = true;
  // Lower bounds of the similarity thresholds, so that noise in even surroundings makes no pair
  // dissimilar. Shares of the depth prior's range and of one channel's range. 0: none, as in the
  // paper; [0, 1].
  float perception_depth_floor = 0.005f;
  float perception_color_floor = 0.03f;
  // Minimum mean IoU of a mask with the masks of near views. A mask under it that at least three
  // near views see is not trained on, see StandsAlone. 0: all masks are. [0, 1]. Off, because it
  // loses (tests/bench/results/mask_agreement.md).
  double min_mask_agreement = 0;
  // Adds the masks that a view lacks and the near views agree on, see CompleteMasks, if the
  // MaskQuality of the capture is under kCompleteBelow.
  bool complete_masks = true;
  // Lets masks of the same thing in several views have one scale, see ShareScales. Measured:
  // tests/bench/results/priors.md.
  bool share_scales = true;
  // Number of steps whose samples are drawn ahead. Each view is rasterised once in that many steps,
  // and their blend rows are kept, 1 to 3 MB a step. [1, 100,000].
  int steps_per_chunk = 750;
  // Minimum share by which the loss must fall from one window of at least 500 steps to the next. If
  // it falls by less, the schedule ends with `closing_share` of its steps, in which the learning
  // rate falls faster. 0: never; [0, 1].
  double min_loss_fall = 0.01;
  double closing_share = 0.5;  // [0, 1]
  // Minimum number of training views (and at least a sixth of them) that must see a Gaussian before
  // its feature gets full blending weight, see FeatureConfidence; suppresses floaters. 0: all
  // features count in full; [0, 64].
  int sure_views = 8;
  uint64_t seed = 1;
};
// Returns INVALID_ARGUMENT, naming the field, if an option is out of range.
absl::Status Validate(const FeatureOptions& options);

// Returns the number of steps in which features are smoothed.
int NumSmoothedSteps(const FeatureOptions& options);

// Returns the number of numbers of the scale gate.
int NumGateNumbers(const FeatureOptions& options);

}  // namespace pepeseg
