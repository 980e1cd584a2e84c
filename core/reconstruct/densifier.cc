#include "core/reconstruct/densifier.h"

#include "absl/strings/str_cat.h"

namespace pepeseg {

bool Densifier::IsEvery(int every, int step) const {
  const int done = step + 1;
  return done % every == 0 && done >= options_.densify_from * options_.num_steps &&
         done < options_.densify_until * options_.num_steps;
}

bool Densifier::Due(int step) const { return IsEvery(options_.densify_every, step); }

bool Densifier::OpacityResetDue(int step) const {
  return IsEvery(options_.opacity_reset_every, step);
}

absl::Status Densifier::Apply(GaussianState& state, std::mt19937_64& random) const {
  DensityInput input;
  input.count = state.count();
  input.planes = state.DownloadPlanes(0, kOpacityPlane + 1);
  input.grad_sum = state.DownloadGradSums();
  input.num_visible = state.DownloadNumVisible();
  DensityRules rules;
  rules.gradient = options_.densify_gradient;
  rules.clone_size = static_cast<float>(options_.densify_size * scene_radius_);
  rules.min_opacity = options_.prune_opacity;
  rules.max_count = options_.max_gaussians;
  const DensityPlan plan = PlanDensity(input, rules, random);
  if (plan.source.empty()) {
    return absl::FailedPreconditionError(absl::StrCat("density control left none of ", input.count,
                                                      " Gaussians: all are fainter ",
                                                      "than prune_opacity ", rules.min_opacity));
  }
  if (!state.Rearrange(plan.source, plan.is_new)) {
    return absl::ResourceExhaustedError(
        absl::StrCat("out of memory for ", plan.source.size(), " Gaussians"));
  }
  state.UploadPlanes(kMeanPlane, plan.mean_and_log_scale);
  return absl::OkStatus();
}

}  // namespace pepeseg
