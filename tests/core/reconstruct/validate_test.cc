#include <cmath>
#include <functional>
#include <string>

#include "core/reconstruct/reconstruct.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

struct BadOption {
  std::string field;
  std::function<void(ReconstructOptions&)> spoil;
};

TEST(ValidateReconstructOptions, AcceptsTheDefaults) { EXPECT_OK(Validate(ReconstructOptions())); }

TEST(ValidateReconstructOptions, NamesEachFieldThatIsOutOfRange) {
  const float nan = std::nanf("");
  using Options = ReconstructOptions;
  const BadOption cases[] = {
      {"num_steps", [](Options& o) { o.num_steps = 0; }},
      {"num_steps", [](Options& o) { o.num_steps = 10'000'001; }},
      {"sh_degree", [](Options& o) { o.sh_degree = -1; }},
      {"sh_degree", [](Options& o) { o.sh_degree = 4; }},
      {"ssim_weight", [](Options& o) { o.ssim_weight = 1.5f; }},
      {"ssim_weight", [=](Options& o) { o.ssim_weight = nan; }},
      {"mean_learning_rate", [](Options& o) { o.mean_learning_rate = 0; }},
      {"mean_learning_rate_final", [](Options& o) { o.mean_learning_rate_final = 0; }},
      {"mean_learning_rate_final", [=](Options& o) { o.mean_learning_rate_final = nan; }},
      {"mean_rate_pixels", [](Options& o) { o.mean_rate_pixels = 1.5f; }},
      {"rates_fall_from", [](Options& o) { o.rates_fall_from = -0.1; }},
      {"mean_learning_rate_cap", [](Options& o) { o.mean_learning_rate_cap = -1; }},
      {"log_scale_learning_rate", [](Options& o) { o.log_scale_learning_rate = -1; }},
      {"rotation_learning_rate", [](Options& o) { o.rotation_learning_rate = 2; }},
      {"opacity_learning_rate", [=](Options& o) { o.opacity_learning_rate = nan; }},
      {"sh_learning_rate", [](Options& o) { o.sh_learning_rate = -1e-9f; }},
      {"coarse_until", [](Options& o) { o.coarse_until = 1.1; }},
      {"depth_weight", [](Options& o) { o.depth_weight = -0.5f; }},
      {"depth_weight", [=](Options& o) { o.depth_weight = nan; }},
      {"depth_weight_final", [](Options& o) { o.depth_weight_final = -1; }},
      {"depth_local_weight", [=](Options& o) { o.depth_local_weight = nan; }},
      {"depth_local_form", [](Options& o) { o.depth_local_form = DepthLocalForm{0}; }},
      {"depth_window", [](Options& o) { o.depth_window = 0.6f; }},
      {"capture_kind", [](Options& o) { o.capture_kind = CaptureKind{3}; }},
      {"densify_from", [](Options& o) { o.densify_from = -0.1; }},
      {"densify_until", [](Options& o) { o.densify_until = 1.1; }},
      {"densify_every", [](Options& o) { o.densify_every = 0; }},
      {"densify_gradient", [=](Options& o) { o.densify_gradient = nan; }},
      {"densify_size", [](Options& o) { o.densify_size = -1; }},
      {"prune_opacity", [](Options& o) { o.prune_opacity = 0.9f; }},
      {"prune_size", [=](Options& o) { o.prune_size = nan; }},
      {"opacity_reset_every", [](Options& o) { o.opacity_reset_every = 0; }},
      {"max_gaussians", [](Options& o) { o.max_gaussians = 0; }},
      {"refine_keep", [](Options& o) { o.refine_keep = static_cast<RefineKeep>(0); }},
      {"refine_keep", [](Options& o) { o.refine_keep = static_cast<RefineKeep>(4); }},
      {"refine_from", [](Options& o) { o.refine_from = -0.1; }},
      {"refine_length", [=](Options& o) { o.refine_length = nan; }},
      {"refine_candidates", [](Options& o) { o.refine_candidates = 1.1; }},
      {"num_random_points", [](Options& o) { o.num_random_points = 0; }},
  };
  for (const BadOption& bad : cases) {
    Options options;
    bad.spoil(options);
    EXPECT_STATUS(Validate(options), absl::StatusCode::kInvalidArgument, bad.field + " is ");
  }
}

}  // namespace
}  // namespace pepeseg
