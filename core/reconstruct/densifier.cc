#include "core/reconstruct/densifier.h"

#include <algorithm>

#include "absl/strings/str_cat.h"

namespace pepeseg {
namespace {

// Share of densify_gradient that suffices where there is a budget, which limits the number.
constexpr float kBudgetedShare = 0.25f;

}  // namespace

// Counts from 1 here: the first round is due after `every` steps.
bool Densifier::IsEvery(int every, int step) const {
  const int done = step + 1;
  return done % every == 0 && done >= options_.densify_from * options_.num_steps &&
         done < options_.densify_until * options_.num_steps;
}

bool Densifier::Due(int step) const { return IsEvery(options_.densify_every, step); }

bool Densifier::OpacityResetDue(int step) const {
  return !budgeted() && IsEvery(options_.opacity_reset_every, step);
}

// budget = min(max_gaussians, training pixels / pixels_per_gaussian), but at least the number at
// the start.
int64_t Densifier::BudgetAt(int step) const {
  if (!budgeted()) return options_.max_gaussians;
  const double most =
      std::min(static_cast<double>(options_.max_gaussians),
               static_cast<double>(scene_.num_training_pixels) / options_.pixels_per_gaussian);
  const auto first = static_cast<double>(scene_.num_initial);
  // METHOD.md section 1, "Density": linear from the number at the start to `most` between
  // densify_from and densify_until.
  const double share = static_cast<double>(step + 1) / options_.num_steps;
  const double span = options_.densify_until - options_.densify_from;
  const double passed =
      span > 0 ? std::clamp((share - options_.densify_from) / span, 0.0, 1.0) : 1.0;
  return static_cast<int64_t>(first + std::max(0.0, most - first) * passed);
}

// 3DGS prunes by size once the first opacity reset is over. Its prune by the size on screen never
// takes place: densification clears the radii before they are read.
float Densifier::MaxSizeAt(int step) const {
  if (budgeted() || step + 1 <= options_.opacity_reset_every) return 0;
  return static_cast<float>(double{options_.prune_size} * scene_.radius);
}

// The backend plans the new rows: for each its source Gaussian, whether it is a child, and its mean
// and scales. The state is then rebuilt by that plan, in Morton order.
absl::Status Densifier::Apply(int step, bool has_depth, GaussianState& state,
                              std::mt19937_64& random) const {
  const DensityStats stats = state.stats();
  Buffer<int32_t> source;
  Buffer<uint8_t> is_new;
  Buffer<float> mean_log_scale;
  DensityCounts counts;
  backend_.PlanDensity(
      {.gaussians = state.parameters(),
       .mean2d_grad_sum = stats.mean2d_grad_sum,
       .square_sum = stats.square_sum,
       .num_visible = stats.num_visible,
       .min_gradient = (budgeted() ? kBudgetedShare : 1) * options_.densify_gradient,
       .clone_size = static_cast<float>(options_.densify_size * scene_.radius),
       .min_opacity = options_.prune_opacity,
       .max_size = MaxSizeAt(step),
       .max_count = BudgetAt(step),
       .draws = budgeted(),
       .keeps_parent = budgeted() && !has_depth,
       // One draw from the training's engine a round: the backend derives all its random numbers
       // from it, so that a resumed training splits the same Gaussians.
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
                     " Gaussians: all are fainter than prune_opacity ", options_.prune_opacity,
                     " or larger than prune_size ", options_.prune_size));
  }
  if (!state.Rearrange(source.span(), is_new.span())) {
    return absl::ResourceExhaustedError(
        absl::StrCat("out of memory for ", counts.num_rows, " Gaussians"));
  }
  state.SetMeansAndLogScales(mean_log_scale.span());
  // In place of the opacity resets of 3DGS, which OpacityResetDue leaves out where there is a
  // budget.
  if (budgeted()) state.FadeOpacity(options_.opacity_decay);
  return absl::OkStatus();
}

}  // namespace pepeseg
