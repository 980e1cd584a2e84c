#include "core/reconstruct/options.h"

#include "kernels/gaussian_planes.h"

namespace pepeseg {

void VisitOptions(ReconstructOptions& o, OptionVisitor visit) {
  constexpr Range kShare = {0, 1}, kRate = {0, 1}, kMany = {1, 1e9}, kSize = {0, 1e9};
  // The means' rates must be over 0, because the schedule takes the ratio of their logarithms.
  constexpr Range kMeanRate = {1e-12, 1};
  visit({"num_steps", &o.num_steps, Range{1, 10'000'000}});
  visit({"views_at_once", &o.views_at_once, Range{0, kMaxUpdateSteps}});
  visit({"photographs_on_host", &o.photographs_on_host});
  visit({"sh_degree", &o.sh_degree, Range{0, kMaxShDegree}});
  visit({"ssim_weight", &o.ssim_weight, Range{0, 1}});
  visit({"mean_learning_rate", &o.mean_learning_rate, kMeanRate});
  visit({"mean_learning_rate_final", &o.mean_learning_rate_final, kMeanRate});
  visit({"mean_rate_pixels", &o.mean_rate_pixels, Range{0, 1}});
  visit({"mean_learning_rate_cap", &o.mean_learning_rate_cap, kSize});
  visit({"rates_fall_from", &o.rates_fall_from, kShare});
  visit({"log_scale_learning_rate", &o.log_scale_learning_rate, kRate});
  visit({"rotation_learning_rate", &o.rotation_learning_rate, kRate});
  visit({"opacity_learning_rate", &o.opacity_learning_rate, kRate});
  visit({"sh_learning_rate", &o.sh_learning_rate, kRate});
  visit({"second_moment_decay", &o.second_moment_decay, Range{0.5, 0.9999}});
  visit({"few_visits", &o.few_visits, kSize});
  visit({"few_visits_steps", &o.few_visits_steps, kShare});
  visit({"dropout", &o.dropout, Range{0, 0.9}});
  visit({"dropout_until", &o.dropout_until, kShare});
  visit({"blurred_share", &o.blurred_share, kShare});
  visit({"coarse_until", &o.coarse_until, kShare});
  visit({"megapixels_per_step", &o.megapixels_per_step, kSize});
  visit({"full_size_visits", &o.full_size_visits, Range{0, 1'000'000}});
  visit({"depth_weight", &o.depth_weight, Range{.low = 0, .high = 10, .also = -1}});
  visit({"depth_weight_final", &o.depth_weight_final, Range{0, 10}});
  visit({"depth_local_weight", &o.depth_local_weight, Range{0, 10}});
  visit({"depth_local_form",
         WordsOf<DepthLocalForm>(&o.depth_local_form, {{"windows", DepthLocalForm::kWindows},
                                                       {"patch", DepthLocalForm::kPatch}})});
  visit({"depth_window", &o.depth_window, Range{0, 0.5}});
  visit({"disparity_as_inverse_depth", &o.disparity_as_inverse_depth});
  visit({"depth_over_alpha", &o.depth_over_alpha});
  visit({"capture_kind",
         WordsOf<CaptureKind>(&o.capture_kind, {{"auto", CaptureKind::kAutomatic},
                                                {"orbit", CaptureKind::kOrbit},
                                                {"forward_facing", CaptureKind::kForwardFacing}})});
  visit({"densify_from", &o.densify_from, kShare});
  visit({"densify_until", &o.densify_until, kShare});
  visit({"densify_every", &o.densify_every, kMany});
  visit({"densify_gradient", &o.densify_gradient, kSize});
  visit({"densify_size", &o.densify_size, kSize});
  visit({"prune_opacity", &o.prune_opacity, Range{0, 0.5}});
  visit({"prune_size", &o.prune_size, kSize});
  visit({"opacity_reset_every", &o.opacity_reset_every, kMany});
  visit({"max_gaussians", &o.max_gaussians, Range{1, 100'000'000}});
  visit({"pixels_per_gaussian", &o.pixels_per_gaussian, kSize});
  visit({"camera_clearance", &o.camera_clearance, Range{0, 1}});
  visit({"opacity_decay", &o.opacity_decay, Range{0.01, 1}});
  visit({"refine_keep", WordsOf<RefineKeep>(&o.refine_keep, {{"none", RefineKeep::kNone},
                                                             {"shrink", RefineKeep::kShrink},
                                                             {"split", RefineKeep::kSplit}})});
  visit({"refine_from", &o.refine_from, kShare});
  visit({"refine_length", &o.refine_length, kShare});
  visit({"refine_candidates", &o.refine_candidates, kShare});
  visit({"min_loss_fall", &o.min_loss_fall, Range{0, 1}});
  visit({"closing_share", &o.closing_share, kShare});
  visit({"min_band_gain", &o.min_band_gain, Range{0, 100}});
  visit({"min_depth_agreement", &o.min_depth_agreement, Range{0, 1}});
  visit({"num_random_points", &o.num_random_points, Range{1, 10'000'000}});
  visit({"seed", &o.seed});
}

absl::Status Validate(const ReconstructOptions& options) { return CheckOptions(options); }

}  // namespace pepeseg
