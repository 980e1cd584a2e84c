#pragma once

#include <CLI/CLI.hpp>

#include "core/reconstruct/options.h"
#include "core/train/training_settings.h"

namespace pepeseg {

// Adds --preset NAME, which sets both stages before the other flags are applied, at any position.
inline void AddPresetFlag(CLI::App& app, ReconstructOptions& stage_one, FeatureOptions& stage_two) {
  app.add_option_function<std::string>(
         "--preset",
         [&](const std::string& name) {
           const Preset preset = name == "preview" ? Preset::kPreview
                                 : name == "best"  ? Preset::kBest
                                 : name == "paper" ? Preset::kPaper
                                                   : Preset::kStandard;
           Apply(preset, stage_one, stage_two);
         },
         "preview, standard, best or paper")
      ->check(CLI::IsMember({"preview", "standard", "best", "paper"}))
      ->trigger_on_parse();
}

// Adds the options of stage one as flags.
inline void AddStageOneFlags(CLI::App& app, ReconstructOptions& stage) {
  app.option_defaults()->multi_option_policy(CLI::MultiOptionPolicy::TakeLast);
  app.add_option("--steps", stage.num_steps);
  app.add_option("--views-at-once", stage.views_at_once);
  app.add_option("--sh", stage.sh_degree);
  app.add_option("--ssim-weight", stage.ssim_weight);
  app.add_option("--mean-rate", stage.mean_learning_rate);
  app.add_option("--mean-rate-final", stage.mean_learning_rate_final);
  app.add_option("--mean-rate-pixels", stage.mean_rate_pixels);
  app.add_option("--rates-fall-from", stage.rates_fall_from);
  app.add_option("--mean-rate-cap", stage.mean_learning_rate_cap);
  app.add_option("--scale-rate", stage.log_scale_learning_rate);
  app.add_option("--rotation-rate", stage.rotation_learning_rate);
  app.add_option("--opacity-rate", stage.opacity_learning_rate);
  app.add_option("--sh-rate", stage.sh_learning_rate);
  app.add_option("--coarse-until", stage.coarse_until);
  app.add_option("--max-megapixels", stage.max_megapixels);
  app.add_option("--depth-weight", stage.depth_weight);
  app.add_option("--depth-weight-final", stage.depth_weight_final);
  app.add_option("--depth-local-weight", stage.depth_local_weight);
  app.add_option("--depth-local-form", stage.depth_local_form, "1 windows, 2 patch");
  app.add_option("--depth-window", stage.depth_window);
  app.add_option("--disparity-as-inverse-depth", stage.disparity_as_inverse_depth);
  app.add_option("--depth-over-alpha", stage.depth_over_alpha);
  app.add_option("--densify-from", stage.densify_from);
  app.add_option("--densify-until", stage.densify_until);
  app.add_option("--densify-every", stage.densify_every);
  app.add_option("--densify-gradient", stage.densify_gradient);
  app.add_option("--densify-size", stage.densify_size);
  app.add_option("--prune-opacity", stage.prune_opacity);
  app.add_option("--prune-size", stage.prune_size);
  app.add_option("--opacity-reset-every", stage.opacity_reset_every);
  app.add_option("--pixels-per-gaussian", stage.pixels_per_gaussian);
  app.add_option("--opacity-decay", stage.opacity_decay);
  app.add_option("--camera-clearance", stage.camera_clearance);
  app.add_option("--dropout", stage.dropout);
  app.add_option("--dropout-until", stage.dropout_until);
  app.add_option("--blurred-share", stage.blurred_share);
  app.add_option("--max-gaussians", stage.max_gaussians);
  app.add_option("--refine-keep", stage.refine_keep, "1 none, 2 shrink, 3 split");
  app.add_option("--refine-from", stage.refine_from);
  app.add_option("--refine-length", stage.refine_length);
  app.add_option("--refine-candidates", stage.refine_candidates);
  app.add_option("--min-loss-fall", stage.min_loss_fall);
  app.add_option("--closing-share", stage.closing_share);
  app.add_option("--min-band-gain", stage.min_band_gain);
  app.add_option("--min-depth-agreement", stage.min_depth_agreement);
  app.add_option("--random-points", stage.num_random_points);
  app.add_option("--seed", stage.seed);
}

}  // namespace pepeseg
