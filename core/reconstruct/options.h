#pragma once

#include <cstdint>

#include "absl/status/status.h"
#include "core/base/options.h"
#include "kernels/ops/render.h"

namespace pepeseg {

// Arrangement of the cameras, which decides the weight that depth_weight = -1 stands for (METHOD.md
// section 1, "Depth").
enum class CaptureKind {
  kAutomatic,  // Found from the poses, see FindCaptureKind.
  kOrbit,      // Around what they look at.
  // All in about one direction. The parallax is smaller, so that a depth prior has more to add.
  kForwardFacing,
};

// Effect of refinement on a Gaussian that crosses the border of a mask (METHOD.md section 1,
// "Refinement").
enum class RefineKeep {
  kNone = 1,    // No refinement.
  kShrink = 2,  // The Gaussian becomes its part inside the mask.
  kSplit = 3,   // The part inside stays, and the part outside becomes a second Gaussian.
};

// Options of stage one. Learning rates and density thresholds are those of 3DGS (Kerbl et al.
// 2023); METHOD.md section 7 lists the differences. Schedules are shares of num_steps, so that a
// short run is a short version of the reference one. VisitOptions has their ranges.
struct ReconstructOptions {
  // Number of optimisation steps, one training view each. Measured:
  // tests/bench/results/presets_h200.md.
  int num_steps = 10000;
  // Number of steps that are done at once: each renders its view and finds its gradient with
  // the same Gaussians, and then the updates of the steps follow each other. 0: as many as the
  // device can do at once, see StepsAtOnce; 1 on a CPU. With a depth loss it is 1. Measured:
  // tests/bench/results/views_at_once.md.
  int views_at_once = 0;
  // Whether photographs, and masks for refinement, are kept in the memory of the host, which the
  // device reads over the bus. False: only where the device lacks the room for them.
  bool photographs_on_host = false;
  // Degree of the spherical harmonics of the colour. 0: the colour does not depend on the
  // direction. The degree in use starts at 0 and rises by one every num_steps / 30 steps.
  int sh_degree = 3;
  // Weight of 1 - SSIM in the image loss; L1 gets the rest. 0: L1 only.
  float ssim_weight = 0.2f;
  // Learning rate of the means at the first step, in scene radii; see mean_rate_pixels and
  // mean_learning_rate_cap.
  float mean_learning_rate = 1.6e-4f;
  // Learning rate of the means at the last step, in scene radii, for a first rate of
  // mean_learning_rate; log-linear between. 3DGS has 1.6e-6, with which Gaussians that are
  // born late hardly move. Measured: tests/bench/results/peak_quality.md.
  float mean_learning_rate_final = 1.6e-5f;
  // Smallest learning rate of the means at the first step, in spans of a pixel at the depth of
  // the scene (PixelSpan). 0: no lower bound. Measured: tests/bench/results/peak_quality.md.
  float mean_rate_pixels = 0.06f;
  // Largest learning rate of the means at the first step, in spans of a pixel as mean_rate_pixels.
  // 0: no cap, as in 3DGS.
  float mean_learning_rate_cap = 1;
  // Share of num_steps from which on all rates but that of the means fall, log-linearly to a tenth.
  // 1: they are constant. Measured: tests/bench/results/peak_quality.md.
  double rates_fall_from = 0.8;
  // Learning rate of the logarithms of the standard deviations. 0: fixed.
  float log_scale_learning_rate = 5e-3f;
  // Learning rate of the rotation quaternions. 0: fixed.
  float rotation_learning_rate = 1e-3f;
  // Learning rate of the opacity logits. 0: fixed.
  float opacity_learning_rate = 5e-2f;
  // Learning rate of the spherical harmonics of degree 0; higher degrees get 1/20 of it. 0:
  // fixed.
  float sh_learning_rate = 2.5e-3f;
  // Decay of the second moments of Adam, its beta2. 3DGS has 0.999.
  float second_moment_decay = 0.999f;
  // Visits of each photograph by steps, on average, under which the rates are raised, dropout and
  // densify_gradient lowered, and second_moment_decay is shortened, on more than 100 training views
  // (WithFewVisits). 0: never. Measured: tests/bench/results/real_size.md.
  double few_visits = 135;
  // Share of num_steps that is done at the least on large photographs with rates raised whole, see
  // WithFewVisits.
  double few_visits_steps = 0.7;
  // Share of the Gaussians that each step leaves out (Park et al. 2025, "DropGaussian"), so
  // that no photograph can be explained by a few Gaussians close to its camera. 0: none.
  // Measured: tests/bench/results/dropout.md.
  float dropout = 0.1f;
  // Share of num_steps after which all Gaussians are rendered, as they will be in the end.
  // Measured: tests/bench/results/dropout.md.
  double dropout_until = 0.8;
  // Share of the rounds of the views that a blurred photograph is in (blurred_views.h). 0:
  // blurred photographs are not trained on. 1: they count like the others. Measured:
  // tests/bench/results/blur.md.
  double blurred_share = 0.25;
  // Share of num_steps trained on smaller photographs: at a quarter of their size in its first
  // half, at half of it in its second half; megapixels_per_step may raise it. 0: full size
  // throughout. Measured: tests/bench/results/presets_h200.md.
  double coarse_until = 0;
  // Most megapixels that a step renders on average. Where steps would render more, coarse_until
  // is raised, to at most 0.95, and pixels_per_gaussian with it (WithPixelBudget). 0: no limit.
  // Measured: tests/bench/results/coarse_start.md, preview_cpu.md.
  double megapixels_per_step = 0.3;
  // Steps at full size that megapixels_per_step leaves to each photograph on average, as far as
  // num_steps suffices. Measured: tests/bench/results/coarse_start.md.
  int full_size_visits = 80;

  // Depth loss (METHOD.md section 1, "Depth").

  // lambda_d of the paper: weight of the depth loss at the first step, on views with a depth
  // prior. -1: as in the paper, 0.05 on an orbit, 0.1 where the views face forward. 0: no
  // depth loss. It gained nothing where it was measured: tests/bench/results/priors.md.
  float depth_weight = 0;
  // Weight of the depth loss at the last step, at most depth_weight; a reversed sigmoid
  // between. 0: the loss fades out. The paper ends at 0.02 and gives no form of the fall; what
  // remains leaves the prior's own error in the model. Measured:
  // tests/bench/results/h200_desk.md.
  float depth_weight_final = 0;
  // Weight of the local fits of the prior, as a multiple of the weight of the depth loss. 0:
  // only the fit to the whole view. 1: as in the paper.
  float depth_local_weight = 0.25f;
  // Regions in which the prior is fitted besides the whole view. Windows and patch differ by
  // less than the seeds do. Measured: tests/bench/results/h200_desk.md.
  DepthLocalForm depth_local_form = DepthLocalForm::kWindows;
  // Radius of the local windows as a share of the view's width; at least one pixel. The paper
  // gives no number.
  float depth_window = 0.025f;
  // Whether a disparity prior is compared with the rendered 1 / z. False: with z itself, as
  // the paper prints it; the fit's scale is then negative.
  bool disparity_as_inverse_depth = true;
  // Whether the rendered depth is divided by alpha and compared only where alpha is over a
  // half and the prior between its 1st and 99th percentiles. False: the plain alpha blend at
  // all pixels, as the paper prints it.
  bool depth_over_alpha = true;
  // Arrangement of the cameras, which decides the weight that depth_weight = -1 stands for.
  CaptureKind capture_kind = CaptureKind::kAutomatic;

  // Density control (METHOD.md section 1, "Density").

  // Share of num_steps after which density control begins.
  double densify_from = 1.0 / 60;
  // Share of num_steps at which density control ends. densify_from or less: no density
  // control.
  double densify_until = 0.76;
  // Steps between two rounds of density control.
  int densify_every = 100;
  // Mean screen-space gradient, |d loss / d mean2d| in NDC units, from which a Gaussian is
  // densified; a quarter of it where pixels_per_gaussian sets a budget.
  float densify_gradient = 2e-4f;
  // Largest standard deviation of a Gaussian that is cloned, in scene radii; a larger one is
  // split.
  float densify_size = 0.01f;
  // Opacity below which density control removes a Gaussian. 0: none is removed.
  float prune_opacity = 0.005f;
  // Standard deviation, in scene radii, above which density control removes a Gaussian from
  // the first opacity reset on; only where pixels_per_gaussian is 0. 0: none is removed.
  float prune_size = 0.1f;
  // Steps between two resets, which limit all opacities to 0.01; only where
  // pixels_per_gaussian is 0.
  int opacity_reset_every = 3000;
  // Maximum number of Gaussians.
  int64_t max_gaussians = 1'000'000;
  // Pixels of the training photographs for each Gaussian of the budget, which max_gaussians
  // limits; more where megapixels_per_step raises coarse_until. Density control approaches the
  // budget linearly between densify_from and densify_until, draws the Gaussians that it densifies,
  // and keeps those that it splits. 0: the density control of 3DGS, with a fixed threshold, opacity
  // resets, and splits into two. Measured: tests/bench/results/h200_desk.md and
  // tests/bench/results/peak_quality.md.
  double pixels_per_gaussian = 50;
  // Radius of the space in front of each training camera in which no Gaussian may be, in scene
  // radii; at most half of the distance of the nearest points. All around a training camera,
  // and up to three quarters of that distance, Gaussians that at most one photograph shows are
  // removed, too. 0: none. Measured: tests/bench/results/free_space.md.
  float camera_clearance = 0.3f;
  // Factor on all opacities at each round of density control with a budget, in place of the
  // resets: what the photographs do not pull back fades and is pruned. 1: no decay.
  float opacity_decay = 0.95f;

  // Gaussian refinement (METHOD.md section 1, "Refinement").

  // Effect of refinement on a Gaussian that crosses the border of a mask, in views with masks.
  // Measured: tests/bench/results/priors.md.
  RefineKeep refine_keep = RefineKeep::kNone;
  // Share of num_steps after which refinement begins, and not before photographs are at full
  // size. The paper: [4000, 4000 + 2V) of 30,000 steps, V = number of training views.
  double refine_from = 4000.0 / 30000;
  // Length of the refinement window as a share of num_steps; at most two steps for each
  // training view. 0: no refinement.
  double refine_length = 200.0 / 30000;
  // Share of the Gaussians in a view that a refinement step examines: those nearest to the
  // rendered depth. 0: no refinement.
  double refine_candidates = 0.1;

  // What a scene does not need, as SceneNeeds decides (METHOD.md section 1, "What a scene does
  // not need").

  // Smallest relative fall of the training loss over a window of at least 500 steps. With
  // less, and once density control, smaller photographs and refinement are over, only the last
  // closing_share of the schedule is still done. 0: all steps are done. Measured:
  // tests/bench/results/presets_h200.md.
  double min_loss_fall = 0.01;
  // Share of num_steps, at the end of the schedule, that is done even after the loss has
  // stopped falling.
  double closing_share = 0.2;
  // Smallest gain of the training views' PSNR, dB, for which higher degrees of the spherical
  // harmonics are kept; measured at 30 % of num_steps. 0: all are kept. Measured:
  // tests/bench/results/skips_h200.md.
  double min_band_gain = 0.1;
  // Smallest share of comparisons of a depth prior with the rendered depth that must agree;
  // with less in two windows of steps in a row the depth loss is left out. 0: it is never left
  // out. Measured: tests/bench/results/presets_h200.md.
  double min_depth_agreement = 0.5;

  // Start of the training.

  // Number of random points to start from where the dataset has none.
  int64_t num_random_points = 20'000;
  // Seed of all random draws of the stage.
  uint64_t seed = 1;
};
// Passes each option with its range to `visit`.
void VisitOptions(ReconstructOptions& options, OptionVisitor visit);

// Returns INVALID_ARGUMENT, with the option and its range, unless all options are in range.
absl::Status Validate(const ReconstructOptions& options);

}  // namespace pepeseg
