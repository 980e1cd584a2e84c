#include "core/train/settings/training_settings.h"

#include <gtest/gtest.h>

#include "core/reconstruct/few_visits.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

class PaperPreset : public ::testing::Test {
 protected:
  PaperPreset() { Apply(Preset::kPaper, reconstruct_, features_); }

  ReconstructOptions reconstruct_;
  FeatureOptions features_;
};

TEST_F(PaperPreset, IsValid) {
  EXPECT_OK(Validate(Preset::kPaper));
  EXPECT_OK(Validate(reconstruct_));
  EXPECT_OK(Validate(features_));
}

TEST_F(PaperPreset, HasTheScheduleOf3dgs) {
  EXPECT_EQ(reconstruct_.num_steps, 30000);
  EXPECT_EQ(reconstruct_.sh_degree, 3);
  EXPECT_EQ(reconstruct_.ssim_weight, 0.2f);
  EXPECT_EQ(reconstruct_.mean_learning_rate, 1.6e-4f);
  EXPECT_EQ(reconstruct_.mean_learning_rate_final, 1.6e-6f);
  EXPECT_EQ(reconstruct_.log_scale_learning_rate, 5e-3f);
  EXPECT_EQ(reconstruct_.rotation_learning_rate, 1e-3f);
  EXPECT_EQ(reconstruct_.opacity_learning_rate, 5e-2f);
  EXPECT_EQ(reconstruct_.sh_learning_rate, 2.5e-3f);
  EXPECT_DOUBLE_EQ(reconstruct_.densify_from * 30000, 500);
  EXPECT_DOUBLE_EQ(reconstruct_.densify_until * 30000, 15000);
  EXPECT_EQ(reconstruct_.densify_every, 100);
  EXPECT_EQ(reconstruct_.densify_gradient, 2e-4f);
  EXPECT_EQ(reconstruct_.densify_size, 0.01f);
  EXPECT_EQ(reconstruct_.prune_opacity, 0.005f);
  EXPECT_EQ(reconstruct_.prune_size, 0.1f);
  EXPECT_EQ(reconstruct_.opacity_reset_every, 3000);
  EXPECT_GE(reconstruct_.max_gaussians, 10'000'000);
}

TEST_F(PaperPreset, HasTheDepthLossAndRefinementAsPrinted) {
  EXPECT_EQ(reconstruct_.depth_weight, -1);  // lambda_d: 0.05 or 0.1 by the kind of capture
  EXPECT_EQ(reconstruct_.depth_weight_final, 0.02f);
  EXPECT_EQ(reconstruct_.depth_local_weight, 1);
  EXPECT_EQ(reconstruct_.depth_window, 0.025f);
  EXPECT_FALSE(reconstruct_.disparity_as_inverse_depth);
  EXPECT_FALSE(reconstruct_.depth_over_alpha);
  EXPECT_EQ(reconstruct_.refine_keep, RefineKeep::kShrink);
  EXPECT_DOUBLE_EQ(reconstruct_.refine_from * 30000, 4000);
  EXPECT_EQ(reconstruct_.refine_length, 1);  // Refiner ends after 2V steps
  EXPECT_EQ(reconstruct_.refine_candidates, 0.1);
}

TEST_F(PaperPreset, HasStageTwoAsPrinted) {
  EXPECT_EQ(features_.num_steps, 10000);
  EXPECT_EQ(features_.num_pixels, 1000);
  EXPECT_EQ(features_.num_scales, 10);
  EXPECT_EQ(features_.gate_layers, 2);
  EXPECT_EQ(features_.num_neighbors, 16);
  EXPECT_EQ(features_.num_drawn_neighbors, 16);  // all of them: 8 of 16 is SAGA's code
  EXPECT_EQ(features_.smooth_until, 1);
  EXPECT_EQ(features_.learning_rate, 2.5e-3f);
  EXPECT_EQ(features_.learning_rate_final, 2.5e-3f);
  EXPECT_EQ(features_.scale_mapping, ScaleMapping::kMinMax);
}

TEST_F(PaperPreset, HasPerceptionAndCentroidLossAsPrinted) {
  EXPECT_EQ(features_.perception_weight, 0.2f);
  EXPECT_EQ(features_.perception_threshold, PerceptionThreshold::kWindows);
  EXPECT_DOUBLE_EQ(features_.centroid_from * features_.num_steps, 7000);
  EXPECT_EQ(features_.centroid_every, 200);  // T
  EXPECT_EQ(features_.centroid_pixels, 16'384);
  EXPECT_GT(features_.centroid_views, 1);
  EXPECT_FALSE(features_.centroid_masked_only);
  EXPECT_EQ(features_.centroid_merge_upper, 0.9f);
  EXPECT_EQ(features_.centroid_merge_lower, 0.9f);
  EXPECT_EQ(features_.centroid_weight_upper, 0.3f);  // U
  EXPECT_EQ(features_.centroid_weight_lower, 0.1f);  // L
  EXPECT_EQ(features_.centroid_cosine_upper, 0.9f);  // tau
  EXPECT_EQ(features_.centroid_cosine_lower, 0.9f);
}

// METHOD.md section 7 lists what this engine adds to the paper.
TEST_F(PaperPreset, HasNoneOfOurAdditions) {
  EXPECT_EQ(reconstruct_.pixels_per_gaussian, 0) << "budget, opacity decay";
  EXPECT_EQ(reconstruct_.mean_learning_rate_cap, 0) << "cap by the span of a pixel";
  EXPECT_EQ(reconstruct_.coarse_until, 0) << "smaller photographs first";
  EXPECT_EQ(reconstruct_.megapixels_per_step, 0) << "limit on pixels";
  EXPECT_EQ(reconstruct_.camera_clearance, 0) << "free space in front of cameras";
  EXPECT_EQ(reconstruct_.dropout, 0);
  EXPECT_EQ(reconstruct_.blurred_share, 1);
  EXPECT_EQ(reconstruct_.views_at_once, 1);
  EXPECT_EQ(reconstruct_.min_loss_fall, 0) << "end by convergence";
  EXPECT_EQ(reconstruct_.min_band_gain, 0) << "SH degree pruning";
  EXPECT_EQ(reconstruct_.min_depth_agreement, 0) << "depth priors left out";
  EXPECT_EQ(features_.mask_share, 0) << "sampling mask by mask";
  EXPECT_EQ(features_.num_background_pixels, 0) << "background as a thing";
  EXPECT_EQ(features_.fine_first, 0) << "fine masks first";
  EXPECT_EQ(features_.negative_margin, 0);
  EXPECT_EQ(features_.min_positive_cosine, -1) << "pairs that count for their cosine";
  EXPECT_EQ(features_.max_negative_cosine, 1) << "pairs that count for their cosine";
  EXPECT_TRUE(features_.joint_pair_mean) << "a mean for each kind of pair";
  EXPECT_EQ(features_.min_norm_alpha, 0) << "pixels that are left out of the norm loss";
  EXPECT_EQ(features_.min_mask_agreement, 0) << "removal of masks that stand alone";
  EXPECT_FALSE(features_.complete_masks) << "completion of masks";
  EXPECT_FALSE(features_.share_scales) << "one scale for a thing in all views";
  EXPECT_FALSE(features_.perception_cross_view) << "check by other views' masks";
  EXPECT_FALSE(features_.perception_fit_window) << "window by image and masks";
  EXPECT_TRUE(features_.perception_unlabelled_only) << "pairs of two masked pixels";
  EXPECT_EQ(features_.perception_depth_floor, 0) << "floor of the thresholds";
  EXPECT_EQ(features_.perception_color_floor, 0) << "floor of the thresholds";
  EXPECT_FALSE(features_.centroid_check_masks) << "check of clusters by masks";
  EXPECT_EQ(features_.min_confident_views, 0) << "feature confidence";
  EXPECT_EQ(features_.min_loss_fall, 0) << "end by convergence";
}

TEST(Presets, KeepWhatTheyDoNotDecide) {
  for (const Preset preset : {Preset::kPreview, Preset::kStandard, Preset::kBest, Preset::kPaper}) {
    ReconstructOptions reconstruct;
    FeatureOptions features;
    reconstruct.seed = features.seed = 7;
    features.steps_per_chunk = 50;
    Apply(preset, reconstruct, features);
    EXPECT_EQ(reconstruct.seed, 7);
    EXPECT_EQ(features.seed, 7);
    EXPECT_EQ(features.steps_per_chunk, 50);
  }
}

TEST(Presets, TrainLongerAndWithFewerGaussiansForTheBest) {
  ReconstructOptions preview, standard, best;
  FeatureOptions features;
  Apply(Preset::kPreview, preview, features);
  Apply(Preset::kStandard, standard, features);
  Apply(Preset::kBest, best, features);
  EXPECT_LT(preview.num_steps, standard.num_steps);
  EXPECT_LT(standard.num_steps, best.num_steps);
  EXPECT_GT(best.pixels_per_gaussian, standard.pixels_per_gaussian);
  EXPECT_EQ(preview.dropout, 0);
  EXPECT_GT(best.dropout, standard.dropout);
}

// tests/bench/results/real_size.md.
TEST(Presets, TrainForHalfOfTheStepsOfTheBestOnManyLargePhotographs) {
  ReconstructOptions best;
  FeatureOptions features;
  Apply(Preset::kBest, best, features);
  const ReconstructOptions many = FitToViews(best, {218, 1e6});
  EXPECT_GE(many.num_steps, 14'000);
  EXPECT_LE(many.num_steps, 16'000);
  EXPECT_EQ(many.coarse_until, 0.5);
  EXPECT_FLOAT_EQ(many.log_scale_learning_rate, 3 * best.log_scale_learning_rate);
  for (const ViewPixels small : {ViewPixels{100, 1e6}, ViewPixels{17, 12e6}}) {
    const ReconstructOptions few = FitToViews(best, small);
    EXPECT_EQ(few.num_steps, best.num_steps);
    EXPECT_EQ(few.coarse_until, 0);
    EXPECT_EQ(few.pixels_per_gaussian, best.pixels_per_gaussian);
    EXPECT_EQ(few.log_scale_learning_rate, best.log_scale_learning_rate);
  }
}

}  // namespace
}  // namespace pepeseg
