#pragma once

#include <cstdint>

#include "absl/status/status.h"
#include "core/base/options.h"

namespace pepeseg {

// How a scale in scene units becomes the query scale in [0, 1].
enum class ScaleMapping {
  kQuantiles = 1,  // the share of the masks that are smaller
  kEven = 2,       // linear from the smallest mask to the 99th percentile, see EvenScales
  kMinMax = 3,     // linear from the smallest mask to the largest, as the paper prints it
};

// Thresholds of the perception loss for differences of depth or colour between two pixels.
enum class PerceptionThreshold {
  kDifferences = 1,  // differences between each of the two and the pixels around it
  kGradients = 2,    // differences between adjacent pixels around each of the two, sampled
  kWindows = 3,      // the gradients of all pixels in the window around each of the two, as printed
};

// Options of stage two (METHOD.md sections 2 and 3), which trains a feature for each Gaussian and
// the scale gate, with frozen geometry. VisitOptions has their ranges.
struct FeatureOptions {
  // Number of optimisation steps, one training view each.
  int num_steps = 10000;
  // Number of steps that are done at once: each finds its gradient with the same features, and then
  // the updates of the steps follow each other. 0: as many as the device can do at once, see
  // FeatureStepsAtOnce; 1 on a CPU.
  int views_at_once = 0;
  // Number of pixels sampled in a step under masks that have a scale.
  int num_pixels = 1000;
  // Share of num_pixels that is drawn by mask, each mask with the same probability, so that small
  // parts are sampled, too; the rest is drawn by pixel, as in the paper.
  double mask_share = 0.25;
  // Number of further pixels sampled in a step from what no mask covers in any view. They count as
  // one object, apart from all others. 0: none.
  int num_background_pixels = 200;
  // Number of mask scales sampled in a step; two are not from random masks, see BatchDrawer.
  int num_scales = 10;
  // Share of num_steps during which the masks of a view are added from the finest 30 % to the
  // largest. Objects that touch must come apart before larger masks pull them together, because the
  // gradient that separates two features is zero where they are equal. 0: all masks from the first
  // step, as in the paper. Measured: tests/bench/results/fine_first.md.
  double fine_first = 0.3;
  // Negative pairs below this cosine are not pushed further apart. At most 32 features can be
  // mutually orthogonal; a margin lets many more objects coexist. 0: as in the paper. Measured:
  // tests/bench/results/margin.md.
  float negative_margin = 0.2f;
  // Positive pairs of pixels below this cosine count in every step, however many such pairs there
  // are; the others are drawn. -1: no pair counts for its cosine, as in the paper.
  // SAGA's code has 0.75. Measured: tests/bench/results/margin.md.
  float min_positive_cosine = 0.9f;
  // Cosine over which a pair of pixels that belongs apart counts in every step; the others are
  // drawn. 1: no pair counts for its cosine, as in the paper. SAGA's code has 0.5.
  float max_negative_cosine = 0.5f;
  // Whether the contrastive loss is one mean over all pairs, drawn alike, as in the paper. False: a
  // mean of the pairs that belong together plus a mean of the others, drawn in equal numbers.
  bool joint_pair_mean = false;
  // Alpha over which a pixel counts in the norm loss. 0: all pixels that show anything, as in the
  // paper.
  float min_norm_alpha = 0.9f;
  // Mapping from the size of a mask in the scene to its scale.
  ScaleMapping scale_mapping = ScaleMapping::kQuantiles;
  // Learning rate of Adam at the first step; it falls exponentially.
  float learning_rate = 1e-2f;
  // Learning rate at the last step.
  float learning_rate_final = 1e-4f;
  // Layers of the scale gate psi(s): 1, sigmoid(W s + b), or 2, with 32 hidden units between. The
  // paper has 2.
  int gate_layers = 1;
  // Number of nearest Gaussians over which a feature is smoothed, itself included.
  int num_neighbors = 4;
  // Number of these neighbours that are drawn in a step; at most num_neighbors.
  int num_drawn_neighbors = 2;
  // Share of num_steps in which features are smoothed. From then on each Gaussian learns its own,
  // beginning with what smoothing gave, which makes borders sharper. 0: no smoothing. 1: to the end
  // and in the model, as in SAGA and the paper. Measured: tests/bench/results/smoothing.md.
  double smooth_until = 0.5;
  // Share of num_steps after which the centroid loss begins. Pixels of random views are clustered
  // at the scales 1 (upper, U of the paper) and 0.01 (lower, L).
  double centroid_from = 0.7;
  // T of the paper: steps between two clusterings for the centroid loss.
  int centroid_every = 200;
  // Maximum number of pixels of a view that are clustered.
  int centroid_pixels = 16'384;
  // Number of random views that a clustering for the centroid loss takes.
  int centroid_views = 1;
  // Whether only pixels under masks are clustered. False: pixels of the whole view, as in the
  // paper.
  bool centroid_masked_only = true;
  // Weight of the centroid loss at the scale 1. 0: that scale is left out. The paper has 0.3.
  float centroid_weight_upper = 1.0f;
  // Weight of the centroid loss at the scale 0.01. 0: that scale is left out. The paper has 0.1. On
  // desk it gains nothing measurable, and it loses where many small parts touch
  // (tests/bench/results/h200_segmentation.md).
  float centroid_weight_lower = 0;
  // tau of the paper at the scale 1: a pixel is pulled to the nearest centroid if its cosine with
  // it is larger. The paper has 0.9.
  float centroid_cosine_upper = 0.9f;
  // tau of the paper at the scale 0.01. The paper has 0.9, which pulls touching parts together.
  float centroid_cosine_lower = 0.97f;
  // Cosine over which the mean of a cluster is merged into the nearest centroid, at the scale 1.
  // The paper has 0.9.
  float centroid_merge_upper = 0.9f;
  // Cosine over which a mean is merged into the nearest centroid, at the scale 0.01.
  float centroid_merge_lower = 0.95f;
  // Whether clusters that the masks separate are left out of the centroid loss, see KeepAgreeing.
  bool centroid_check_masks = true;
  // Weight of the perception loss, for pixels that no mask of their view covers. 0: no perception
  // loss; nor is there one if no training view has a depth prior, or if all pixels are covered or
  // background. The paper has 0.2.
  float perception_weight = 0.2f;
  // Number of further pixels sampled in a step for the perception loss.
  int num_perception_pixels = 128;
  // Rule for the similarity thresholds of depth and colour.
  PerceptionThreshold perception_threshold = PerceptionThreshold::kDifferences;
  // Whether the masks of other views override the similarity of depth and colour.
  bool perception_cross_view = true;
  // Whether the window r(s) of the perception loss follows the sizes of image and masks. False:
  // min(H, W) (0.03 + 0.12 s), in [20, 200] pixels. Both are ours: the paper says only that r(s)
  // grows with the scale.
  bool perception_fit_window = true;
  // Whether a pair of the perception loss has a pixel that no mask covers. False: pairs of covered
  // pixels count as well, where the masks agree with depth and colour. The paper leaves those out.
  bool perception_unlabelled_only = true;
  // Lower bound of the similarity threshold for depth, as a share of the depth prior's range, so
  // that noise in even surroundings makes no pair dissimilar. 0: none, as in the paper.
  float perception_depth_floor = 0.005f;
  // Lower bound of the similarity threshold for colour, as a share of one channel's range.
  float perception_color_floor = 0.03f;
  // Minimum mean IoU of a mask with the masks of the near views. A mask below it that at least
  // three near views see is not trained on, see StandsAlone. 0: all masks are trained on, because
  // it loses otherwise (tests/bench/results/mask_agreement.md).
  double min_mask_agreement = 0;
  // Whether a view is also trained on masks that it lacks but most near views that see the surface
  // have, see CompleteMasks. Only if "mask_quality" (see Model.metrics) is below 0.65.
  bool complete_masks = true;
  // Whether masks of the same thing in several views have one scale, the median of those views, see
  // ShareScales. False: each mask has its own. Measured: tests/bench/results/priors.md.
  bool share_scales = true;
  // Number of steps whose samples are drawn together, so that each view is rasterised once for
  // them; a third of it on a GPU, see OfTwoChunks. Their blend rows are kept, 1 to 3 MB per step.
  int steps_per_chunk = 750;
  // Most training views that the steps of a chunk are drawn from: as many, spread evenly over the
  // capture, are rasterised for it; a third of it on a GPU. 0: all views.
  int views_per_chunk = 64;
  // Smallest relative fall of the loss over a window of at least 500 steps. With less, the rest of
  // the schedule is compressed into closing_share of the steps. 0: all steps are done.
  double min_loss_fall = 0.01;
  // Length of the end of a training whose loss has stopped falling, as a share of num_steps.
  double closing_share = 0.5;
  // Minimum number of training views (and at least a sixth of them) that must see a Gaussian before
  // its feature gets full blending weight; with fewer the weight is smaller, which suppresses
  // floaters, see GaussianCoverage. 0: all features have full weight.
  int min_confident_views = 8;
  // Seed of all random draws of the stage.
  uint64_t seed = 1;
};
// Passes each option with its range to `visit`.
void VisitOptions(FeatureOptions& options, OptionVisitor visit);

// Returns INVALID_ARGUMENT, with the option and its range, unless all options are in range.
absl::Status Validate(const FeatureOptions& options);

// Returns the options of chunks of which two are in memory, as on a GPU (BatchSource): a third of
// the steps and of the views, so that a view is rasterised for as many steps as otherwise.
FeatureOptions OfTwoChunks(FeatureOptions options);

// Returns the number of steps in which features are smoothed.
int NumSmoothedSteps(const FeatureOptions& options);

// Returns the number of numbers of the scale gate.
int NumGateNumbers(const FeatureOptions& options);

}  // namespace pepeseg
