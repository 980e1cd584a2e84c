#include "core/train/settings/training_settings.h"

#include "absl/strings/str_cat.h"

namespace pepeseg {
namespace {

// Stage one: 3DGS's schedule, the depth loss and refinement. Steps in the comments are of 30,000.
void SetPaperReconstruct(ReconstructOptions& options) {
  // 3DGS (Kerbl et al. 2023).
  options.num_steps = 30000;
  options.sh_degree = 3;
  options.ssim_weight = 0.2f;
  options.mean_learning_rate = 1.6e-4f;
  options.mean_learning_rate_final = 1.6e-6f;
  options.mean_learning_rate_cap = 0;
  options.mean_rate_pixels = 0;
  options.rates_fall_from = 1;
  options.log_scale_learning_rate = 5e-3f;
  options.rotation_learning_rate = 1e-3f;
  options.opacity_learning_rate = 5e-2f;
  options.sh_learning_rate = 2.5e-3f;
  options.second_moment_decay = 0.999f;
  options.few_visits = 0;
  options.densify_from = 500.0 / 30000;
  options.densify_until = 15000.0 / 30000;
  options.densify_every = 100;
  options.densify_gradient = 2e-4f;
  options.densify_size = 0.01f;
  options.prune_opacity = 0.005f;
  options.prune_size = 0.1f;
  options.opacity_reset_every = 3000;
  options.pixels_per_gaussian = 0;
  // The method has no cap. 3DGS stays below this number on its own scenes, and what a training may
  // need is reserved in advance.
  options.max_gaussians = 10'000'000;
  options.camera_clearance = 0;
  options.dropout = 0;
  options.blurred_share = 1;
  options.views_at_once = 1;

  // L_global + L_local with lambda_d from 0.05 (orbit) or 0.1 (forward facing) to 0.02.
  options.depth_weight = -1;
  options.depth_weight_final = 0.02f;
  options.depth_local_weight = 1;
  options.depth_window = 0.025f;
  options.disparity_as_inverse_depth = false;
  options.depth_over_alpha = false;

  // Refinement in [4000, 4000 + 2V): 2V is the limit that Refiner sets, so the length is open.
  options.refine_keep = RefineKeep::kShrink;
  options.refine_from = 4000.0 / 30000;
  options.refine_length = 1;
  options.refine_candidates = 0.1;

  // Nothing is skipped, and photographs have their full size throughout.
  options.coarse_until = 0;
  options.megapixels_per_step = 0;
  options.min_loss_fall = 0;
  options.min_band_gain = 0;
  options.min_depth_agreement = 0;
}

// Stage two: L_m + 0.2 L_p + L_c and the norms.
void SetPaperFeatures(FeatureOptions& options) {
  options.num_steps = 10000;
  options.num_scales = 10;
  options.scale_mapping = ScaleMapping::kMinMax;
  options.gate_layers = 2;
  options.num_neighbors = 16;
  options.num_drawn_neighbors = 16;
  options.smooth_until = 1;
  options.learning_rate = 2.5e-3f;
  options.learning_rate_final = 2.5e-3f;

  // Pixels are drawn uniformly, all masks count from the first step, and masks stay as given.
  options.num_pixels = 1000;
  options.mask_share = 0;
  options.views_per_chunk = 0;
  options.views_at_once = 1;
  options.num_background_pixels = 0;
  options.fine_first = 0;
  options.negative_margin = 0;
  options.min_positive_cosine = -1;
  options.max_negative_cosine = 1;
  options.joint_pair_mean = true;
  options.min_norm_alpha = 0;
  options.min_mask_agreement = 0;
  options.complete_masks = false;
  options.share_scales = false;

  // L_p: a window by the scale alone, thresholds by all gradients in it, masks of this view only,
  // no pair of two masked pixels.
  options.perception_weight = 0.2f;
  options.perception_threshold = PerceptionThreshold::kWindows;
  options.perception_cross_view = false;
  options.perception_fit_window = false;
  options.perception_unlabelled_only = true;
  options.perception_depth_floor = 0;
  options.perception_color_floor = 0;

  // L_c: T = 200, from 7,000 steps on; tau and the weights of U and L. Whole maps of several views,
  // of which HDBSCAN's time allows a sample.
  options.centroid_from = 0.7;
  options.centroid_every = 200;
  options.centroid_pixels = 16'384;
  options.centroid_views = 4;
  options.centroid_masked_only = false;
  options.centroid_weight_upper = 0.3f;
  options.centroid_weight_lower = 0.1f;
  options.centroid_cosine_upper = 0.9f;
  options.centroid_cosine_lower = 0.9f;
  options.centroid_merge_upper = 0.9f;
  options.centroid_merge_lower = 0.9f;
  options.centroid_check_masks = false;

  options.min_confident_views = 0;
  options.min_loss_fall = 0;
}

}  // namespace

absl::Status Validate(Preset preset) {
  if (preset >= Preset::kPreview && preset <= Preset::kPaper) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("preset is ", static_cast<int>(preset),
                   "; it must be 1 (preview), 2 (standard), 3 (best) or 4 (paper)"));
}

void SetPaper(ReconstructOptions& reconstruct, FeatureOptions& features) {
  SetPaperReconstruct(reconstruct);
  SetPaperFeatures(features);
}

void Apply(Preset preset, ReconstructOptions& reconstruct, FeatureOptions& features) {
  // kStandard leaves the defaults of the options.
  if (preset == Preset::kPreview) {
    reconstruct.num_steps = 2000;
    reconstruct.coarse_until = 0.5;
    // Larger photographs are seen at full size for fewer steps: tests/bench/results/preview_cpu.md.
    reconstruct.megapixels_per_step = 0.15;
    reconstruct.full_size_visits = 0;
    reconstruct.sh_degree = 1;
    reconstruct.dropout = 0;  // costs more than it gains in 2,000 steps
    features.num_steps = 1500;
    features.num_pixels = 700;  // tests/bench/results/preview_cpu.md
  } else if (preset == Preset::kBest) {
    // Fewer Gaussians train faster and overfit less: tests/bench/results/peak_quality.md.
    reconstruct.num_steps = 30000;
    reconstruct.pixels_per_gaussian = 75;
    // On more than 100 training views rates are always raised, and large photographs are trained on
    // at smaller sizes first and for about half of the steps: tests/bench/results/real_size.md.
    reconstruct.few_visits = 900;
    reconstruct.few_visits_steps = 14.0 / 30;
    reconstruct.full_size_visits = 1'000'000;  // on fewer views: all steps
    reconstruct.log_scale_learning_rate = 7.5e-3f;
    reconstruct.opacity_learning_rate = 3.5e-2f;
    // Photographs that are few or noisy: tests/bench/results/peak_quality.md.
    reconstruct.dropout = 0.2f;
    features.num_steps = 20000;
    // In more steps features follow rough masks further: tests/bench/results/smoothing.md.
    features.smooth_until = 0.65;
  } else if (preset == Preset::kPaper) {
    SetPaper(reconstruct, features);
  }
}

}  // namespace pepeseg
