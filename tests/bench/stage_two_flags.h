#pragma once

#include <CLI/CLI.hpp>

#include "core/features/options.h"

namespace pepeseg {

// Adds the options of stage two as flags, next to those of stage one.
inline void AddStageTwoFlags(CLI::App& app, FeatureOptions& stage) {
  app.option_defaults()->multi_option_policy(CLI::MultiOptionPolicy::TakeLast);
  app.add_option("--feature-steps", stage.num_steps);
  app.add_option("--feature-pixels", stage.num_pixels);
  app.add_option("--mask-share", stage.mask_share);
  app.add_option("--background-pixels", stage.num_background_pixels);
  app.add_option("--feature-scales", stage.num_scales);
  app.add_flag_callback("--even-scales", [&stage] { stage.scale_mapping = ScaleMapping::kEven; });
  app.add_flag_callback("--quantile-scales",
                        [&stage] { stage.scale_mapping = ScaleMapping::kQuantiles; });
  app.add_flag_callback("--min-max-scales",
                        [&stage] { stage.scale_mapping = ScaleMapping::kMinMax; });
  app.add_option("--feature-rate", stage.learning_rate);
  app.add_option("--feature-rate-final", stage.learning_rate_final);
  app.add_option("--centroid-from", stage.centroid_from);
  app.add_option("--centroid-every", stage.centroid_every);
  app.add_option("--centroid-pixels", stage.centroid_pixels);
  app.add_option("--centroid-upper", stage.centroid_weight_upper);
  app.add_option("--centroid-lower", stage.centroid_weight_lower);
  app.add_option("--centroid-cosine-upper", stage.centroid_cosine_upper);
  app.add_option("--centroid-cosine-lower", stage.centroid_cosine_lower);
  app.add_option("--centroid-check-masks", stage.centroid_check_masks);
  app.add_option("--perception-weight", stage.perception_weight);
  app.add_option("--perception-pixels", stage.num_perception_pixels);
  app.add_flag("!--no-cross-view", stage.perception_cross_view,
               "do not check the perception loss against the masks of other views");
  app.add_option("--perception-fit-window", stage.perception_fit_window);
  app.add_option("--perception-unlabelled-only", stage.perception_unlabelled_only);
  app.add_option("--perception-depth-floor", stage.perception_depth_floor);
  app.add_option("--perception-color-floor", stage.perception_color_floor);
  app.add_option("--min-mask-agreement", stage.min_mask_agreement);
  app.add_option("--complete-masks", stage.complete_masks);
  app.add_option("--share-scales", stage.share_scales);
  app.add_option("--fine-first", stage.fine_first);
  app.add_option("--negative-margin", stage.negative_margin);
  app.add_option("--min-positive-cosine", stage.min_positive_cosine);
  app.add_option("--max-negative-cosine", stage.max_negative_cosine);
  app.add_option("--joint-pair-mean", stage.joint_pair_mean);
  app.add_option("--min-norm-alpha", stage.min_norm_alpha);
  app.add_option("--centroid-views", stage.centroid_views);
  app.add_option("--centroid-masked-only", stage.centroid_masked_only);
  app.add_option("--centroid-merge-upper", stage.centroid_merge_upper);
  app.add_option("--centroid-merge-lower", stage.centroid_merge_lower);
  app.add_flag_callback("--perception-gradients",
                        [&stage] { stage.perception_threshold = PerceptionThreshold::kGradients; });
  app.add_flag_callback("--perception-windows",
                        [&stage] { stage.perception_threshold = PerceptionThreshold::kWindows; });
  app.add_option("--gate-layers", stage.gate_layers);
  app.add_option("--neighbors", stage.num_neighbors);
  app.add_option("--drawn-neighbors", stage.num_drawn_neighbors);
  app.add_option("--smooth-until", stage.smooth_until);
  app.add_option("--feature-chunk", stage.steps_per_chunk, "steps");
  app.add_option("--feature-loss-fall", stage.min_loss_fall);
  app.add_option("--feature-closing", stage.closing_share);
  app.add_option("--sure-views", stage.sure_views);
  app.add_option("--feature-seed", stage.seed);
}

}  // namespace pepeseg
