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
  const DensityStats stats = state.stats();
  Buffer<int32_t> source;
  Buffer<uint8_t> is_new;
  Buffer<float> mean_log_scale;
  DensityCounts counts;
  backend_.PlanDensity({.gaussians = state.parameters(),
                        .mean2d_grad_sum = stats.mean2d_grad_sum,
                        .num_visible = stats.num_visible,
                        .min_gradient = options_.densify_gradient,
                        .clone_size = static_cast<float>(options_.densify_size * scene_radius_),
                        .min_opacity = options_.prune_opacity,
                        .max_count = options_.max_gaussians,
                        .seed = static_cast<uint32_t>(random()),
                        .source = &source,
                        .is_new = &is_new,
                        .mean_log_scale = &mean_log_scale,
                        .counts = &counts});
  if (const std::string error = backend_.error(); !error.empty()) {
    return absl::ResourceExhaustedError(absl::StrCat("density control: ", error));
  }
  if (counts.num_rows == 0) {
    return absl::FailedPreconditionError(
        absl::StrCat("density control left none of ", state.count(),
                     " Gaussians: all are fainter than prune_opacity ", options_.prune_opacity));
  }
  if (!state.Rearrange(source.span(), is_new.span())) {
    return absl::ResourceExhaustedError(
        absl::StrCat("out of memory for ", counts.num_rows, " Gaussians"));
  }
  state.SetMeansAndLogScales(mean_log_scale.span());
  return absl::OkStatus();
}

}  // namespace pepeseg
