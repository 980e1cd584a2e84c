#include "core/features/options.h"

#include <algorithm>
#include <cmath>

#include "core/base/errors.h"
#include "core/base/status_macros.h"
#include "kernels/backend.h"
#include "kernels/ops/feature.h"
#include "kernels/ops/smooth.h"

namespace pepeseg {

void VisitOptions(FeatureOptions& o, OptionVisitor visit) {
  constexpr double kMaxCosine = 0.9999;
  visit({"num_steps", &o.num_steps, Range{1, 10'000'000}});
  visit({"views_at_once", &o.views_at_once, Range{0, kMaxBranches}});
  visit({"num_pixels", &o.num_pixels, Range{2, 16'384}});  // 2: a pair takes two pixels
  visit({"mask_share", &o.mask_share, Range{0, 1}});
  visit({"num_background_pixels", &o.num_background_pixels, Range{0, 16'384}});
  visit({"num_scales", &o.num_scales, Range{1, kMaxScales}});
  visit({"fine_first", &o.fine_first, Range{0, 0.9}});
  visit({"negative_margin", &o.negative_margin, Range{0, 0.9}});
  visit({"min_positive_cosine", &o.min_positive_cosine, Range{-1, 1}});
  visit({"max_negative_cosine", &o.max_negative_cosine, Range{-1, 1}});
  visit({"joint_pair_mean", &o.joint_pair_mean});
  visit({"min_norm_alpha", &o.min_norm_alpha, Range{0, 1}});
  visit({"scale_mapping",
         WordsOf<ScaleMapping>(&o.scale_mapping, {{"quantiles", ScaleMapping::kQuantiles},
                                                  {"even", ScaleMapping::kEven},
                                                  {"min_max", ScaleMapping::kMinMax}})});
  // Over 0, because the schedule is a power of learning_rate_final / learning_rate.
  visit({"learning_rate", &o.learning_rate, Range{1e-8, 1}});
  visit({"learning_rate_final", &o.learning_rate_final, Range{1e-8, 1}});
  visit({"gate_layers", &o.gate_layers, Range{1, 2}});
  visit({"num_neighbors", &o.num_neighbors, Range{1, kMaxNeighbors}});
  visit({"num_drawn_neighbors", &o.num_drawn_neighbors, Range{1, kMaxNeighbors}});
  visit({"smooth_until", &o.smooth_until, Range{0, 1}});
  visit({"centroid_from", &o.centroid_from, Range{0, 1}});
  visit({"centroid_every", &o.centroid_every, Range{1, 10'000'000}});
  visit({"centroid_pixels", &o.centroid_pixels, Range{1, 65'536}});
  visit({"centroid_views", &o.centroid_views, Range{1, 1000}});
  visit({"centroid_masked_only", &o.centroid_masked_only});
  visit({"centroid_weight_upper", &o.centroid_weight_upper, Range{0, 100}});
  visit({"centroid_weight_lower", &o.centroid_weight_lower, Range{0, 100}});
  visit({"centroid_cosine_upper", &o.centroid_cosine_upper, Range{0, kMaxCosine}});
  visit({"centroid_cosine_lower", &o.centroid_cosine_lower, Range{0, kMaxCosine}});
  visit({"centroid_merge_upper", &o.centroid_merge_upper, Range{0, kMaxCosine}});
  visit({"centroid_merge_lower", &o.centroid_merge_lower, Range{0, kMaxCosine}});
  visit({"centroid_check_masks", &o.centroid_check_masks});
  visit({"perception_weight", &o.perception_weight, Range{0, 100}});
  visit({"num_perception_pixels", &o.num_perception_pixels, Range{1, 16'384}});
  visit({"perception_threshold",
         WordsOf<PerceptionThreshold>(&o.perception_threshold,
                                      {{"differences", PerceptionThreshold::kDifferences},
                                       {"gradients", PerceptionThreshold::kGradients},
                                       {"windows", PerceptionThreshold::kWindows}})});
  visit({"perception_cross_view", &o.perception_cross_view});
  visit({"perception_fit_window", &o.perception_fit_window});
  visit({"perception_unlabelled_only", &o.perception_unlabelled_only});
  visit({"perception_depth_floor", &o.perception_depth_floor, Range{0, 1}});
  visit({"perception_color_floor", &o.perception_color_floor, Range{0, 1}});
  visit({"min_mask_agreement", &o.min_mask_agreement, Range{0, 1}});
  visit({"complete_masks", &o.complete_masks});
  visit({"share_scales", &o.share_scales});
  visit({"steps_per_chunk", &o.steps_per_chunk, Range{1, 100'000}});
  visit({"views_per_chunk", &o.views_per_chunk, Range{0, 100'000}});
  visit({"min_loss_fall", &o.min_loss_fall, Range{0, 1}});
  visit({"closing_share", &o.closing_share, Range{0, 1}});
  visit({"min_confident_views", &o.min_confident_views, Range{0, 64}});
  visit({"seed", &o.seed});
}

absl::Status Validate(const FeatureOptions& options) {
  RETURN_IF_ERROR(CheckOptions(options));
  return CheckInRange("num_drawn_neighbors", options.num_drawn_neighbors, 1, options.num_neighbors);
}

FeatureOptions OfTwoChunks(FeatureOptions options) {
  constexpr int kShorter = 3;
  options.steps_per_chunk = std::max(1, options.steps_per_chunk / kShorter);
  // 0 stays: all views.
  if (options.views_per_chunk > 0) {
    options.views_per_chunk = std::max(1, options.views_per_chunk / kShorter);
  }
  return options;
}

int NumSmoothedSteps(const FeatureOptions& options) {
  return static_cast<int>(std::lround(options.smooth_until * options.num_steps));
}

int NumGateNumbers(const FeatureOptions& options) {
  return options.gate_layers == 2 ? kTwoLayerGateSize : kGateSize;
}

}  // namespace pepeseg
