#include "core/reconstruct/options.h"

#include "core/base/errors.h"
#include "core/base/status_macros.h"
#include "kernels/gaussian_planes.h"
#include "kernels/ops/render.h"

namespace pepeseg {
namespace {

constexpr auto& InRange = CheckInRange<double>;

// The means' rates must be over 0, because the schedule takes the ratio of their logarithms.
absl::Status ValidateLearningRates(const ReconstructOptions& options) {
  constexpr double kMax = 1;
  RETURN_IF_ERROR(InRange("mean_learning_rate", options.mean_learning_rate, 1e-12, kMax));
  RETURN_IF_ERROR(
      InRange("mean_learning_rate_final", options.mean_learning_rate_final, 1e-12, kMax));
  RETURN_IF_ERROR(InRange("mean_rate_pixels", options.mean_rate_pixels, 0, 1));
  RETURN_IF_ERROR(InRange("rates_fall_from", options.rates_fall_from, 0, 1));
  RETURN_IF_ERROR(InRange("mean_learning_rate_cap", options.mean_learning_rate_cap, 0, 1e9));
  RETURN_IF_ERROR(InRange("log_scale_learning_rate", options.log_scale_learning_rate, 0, kMax));
  RETURN_IF_ERROR(InRange("rotation_learning_rate", options.rotation_learning_rate, 0, kMax));
  RETURN_IF_ERROR(InRange("opacity_learning_rate", options.opacity_learning_rate, 0, kMax));
  return InRange("sh_learning_rate", options.sh_learning_rate, 0, kMax);
}

absl::Status ValidateDepth(const ReconstructOptions& options) {
  constexpr double kMaxWeight = 10;
  if (options.depth_weight != -1) {  // -1: chosen by the kind of capture, see WithDepthWeight
    RETURN_IF_ERROR(InRange("depth_weight", options.depth_weight, 0, kMaxWeight));
  }
  RETURN_IF_ERROR(InRange("depth_weight_final", options.depth_weight_final, 0, kMaxWeight));
  RETURN_IF_ERROR(InRange("depth_local_weight", options.depth_local_weight, 0, kMaxWeight));
  RETURN_IF_ERROR(InRange("depth_local_form", static_cast<int>(options.depth_local_form), 1, 2));
  RETURN_IF_ERROR(InRange("depth_window", options.depth_window, 0, 0.5));
  return InRange("capture_kind", static_cast<int>(options.capture_kind), 0, 2);
}

absl::Status ValidateDensityControl(const ReconstructOptions& options) {
  RETURN_IF_ERROR(InRange("densify_from", options.densify_from, 0, 1));
  RETURN_IF_ERROR(InRange("densify_until", options.densify_until, 0, 1));
  RETURN_IF_ERROR(InRange("densify_every", options.densify_every, 1, 1e9));
  RETURN_IF_ERROR(InRange("densify_gradient", options.densify_gradient, 0, 1e9));
  RETURN_IF_ERROR(InRange("densify_size", options.densify_size, 0, 1e9));
  RETURN_IF_ERROR(InRange("prune_opacity", options.prune_opacity, 0, 0.5));
  RETURN_IF_ERROR(InRange("prune_size", options.prune_size, 0, 1e9));
  RETURN_IF_ERROR(InRange("opacity_reset_every", options.opacity_reset_every, 1, 1e9));
  RETURN_IF_ERROR(InRange("pixels_per_gaussian", options.pixels_per_gaussian, 0, 1e9));
  RETURN_IF_ERROR(InRange("opacity_decay", options.opacity_decay, 0.01, 1));
  RETURN_IF_ERROR(InRange("camera_clearance", options.camera_clearance, 0, 1));
  return InRange("max_gaussians", static_cast<double>(options.max_gaussians), 1, 100e6);
}

absl::Status ValidateRefinement(const ReconstructOptions& options) {
  RETURN_IF_ERROR(InRange("refine_keep", static_cast<double>(options.refine_keep),
                          static_cast<double>(RefineKeep::kNone),
                          static_cast<double>(RefineKeep::kSplit)));
  RETURN_IF_ERROR(InRange("refine_from", options.refine_from, 0, 1));
  RETURN_IF_ERROR(InRange("refine_length", options.refine_length, 0, 1));
  return InRange("refine_candidates", options.refine_candidates, 0, 1);
}

absl::Status ValidateNeeds(const ReconstructOptions& options) {
  RETURN_IF_ERROR(InRange("min_loss_fall", options.min_loss_fall, 0, 1));
  RETURN_IF_ERROR(InRange("closing_share", options.closing_share, 0, 1));
  RETURN_IF_ERROR(InRange("min_band_gain", options.min_band_gain, 0, 100));
  return InRange("min_depth_agreement", options.min_depth_agreement, 0, 1);
}

}  // namespace

absl::Status Validate(const ReconstructOptions& options) {
  RETURN_IF_ERROR(InRange("num_steps", options.num_steps, 1, 10e6));
  RETURN_IF_ERROR(InRange("views_at_once", options.views_at_once, 0, kMaxUpdateSteps));
  RETURN_IF_ERROR(InRange("sh_degree", options.sh_degree, 0, kMaxShDegree));
  RETURN_IF_ERROR(InRange("ssim_weight", options.ssim_weight, 0, 1));
  RETURN_IF_ERROR(ValidateLearningRates(options));
  RETURN_IF_ERROR(InRange("dropout", options.dropout, 0, 0.9));
  RETURN_IF_ERROR(InRange("dropout_until", options.dropout_until, 0, 1));
  RETURN_IF_ERROR(InRange("blurred_share", options.blurred_share, 0, 1));
  RETURN_IF_ERROR(InRange("coarse_until", options.coarse_until, 0, 1));
  RETURN_IF_ERROR(InRange("max_megapixels", options.max_megapixels, 0, 1e9));
  RETURN_IF_ERROR(ValidateDepth(options));
  RETURN_IF_ERROR(ValidateDensityControl(options));
  RETURN_IF_ERROR(ValidateRefinement(options));
  RETURN_IF_ERROR(ValidateNeeds(options));
  return InRange("num_random_points", static_cast<double>(options.num_random_points), 1, 10e6);
}

}  // namespace pepeseg
