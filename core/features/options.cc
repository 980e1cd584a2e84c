#include "core/features/options.h"

#include <cmath>

#include "absl/strings/str_cat.h"
#include "core/base/errors.h"
#include "core/base/status_macros.h"
#include "kernels/ops/feature.h"
#include "kernels/ops/smooth.h"

namespace pepeseg {
namespace {

template <class T>
absl::Status CheckRange(const char* name, T value, T low, T high) {
  return CheckInRange(absl::StrCat("features: ", name), value, low, high);
}

}  // namespace

absl::Status Validate(const FeatureOptions& options) {
  RETURN_IF_ERROR(CheckRange("num_steps", options.num_steps, 1, 10'000'000));
  // 2: a pair takes two pixels.
  RETURN_IF_ERROR(CheckRange("num_pixels", options.num_pixels, 2, 16'384));
  RETURN_IF_ERROR(CheckRange("mask_share", options.mask_share, 0.0, 1.0));
  RETURN_IF_ERROR(CheckRange("num_background_pixels", options.num_background_pixels, 0, 16'384));
  RETURN_IF_ERROR(CheckRange("num_scales", options.num_scales, 1, kMaxScales));
  RETURN_IF_ERROR(CheckRange("fine_first", options.fine_first, 0.0, 0.9));
  RETURN_IF_ERROR(CheckRange("negative_margin", options.negative_margin, 0.0f, 0.9f));
  RETURN_IF_ERROR(CheckRange("min_positive_cosine", options.min_positive_cosine, -1.0f, 1.0f));
  RETURN_IF_ERROR(CheckRange("max_negative_cosine", options.max_negative_cosine, -1.0f, 1.0f));
  RETURN_IF_ERROR(CheckRange("min_norm_alpha", options.min_norm_alpha, 0.0f, 1.0f));
  RETURN_IF_ERROR(CheckRange("scale_mapping", static_cast<int>(options.scale_mapping), 1, 3));
  RETURN_IF_ERROR(CheckRange("learning_rate_final", options.learning_rate_final, 1e-8f, 1.0f));
  RETURN_IF_ERROR(CheckRange("centroid_from", options.centroid_from, 0.0, 1.0));
  RETURN_IF_ERROR(CheckRange("centroid_every", options.centroid_every, 1, 10'000'000));
  RETURN_IF_ERROR(CheckRange("centroid_pixels", options.centroid_pixels, 1, 65'536));
  RETURN_IF_ERROR(CheckRange("centroid_views", options.centroid_views, 1, 1000));
  RETURN_IF_ERROR(CheckRange("centroid_merge_upper", options.centroid_merge_upper, 0.0f, 0.9999f));
  RETURN_IF_ERROR(CheckRange("centroid_merge_lower", options.centroid_merge_lower, 0.0f, 0.9999f));
  RETURN_IF_ERROR(CheckRange("centroid_weight_upper", options.centroid_weight_upper, 0.0f, 100.0f));
  RETURN_IF_ERROR(CheckRange("centroid_weight_lower", options.centroid_weight_lower, 0.0f, 100.0f));
  RETURN_IF_ERROR(
      CheckRange("centroid_cosine_upper", options.centroid_cosine_upper, 0.0f, 0.9999f));
  RETURN_IF_ERROR(
      CheckRange("centroid_cosine_lower", options.centroid_cosine_lower, 0.0f, 0.9999f));
  RETURN_IF_ERROR(CheckRange("perception_weight", options.perception_weight, 0.0f, 100.0f));
  RETURN_IF_ERROR(CheckRange("num_perception_pixels", options.num_perception_pixels, 1, 16'384));
  RETURN_IF_ERROR(
      CheckRange("perception_threshold", static_cast<int>(options.perception_threshold), 1, 3));
  RETURN_IF_ERROR(CheckRange("perception_depth_floor", options.perception_depth_floor, 0.0f, 1.0f));
  RETURN_IF_ERROR(CheckRange("perception_color_floor", options.perception_color_floor, 0.0f, 1.0f));
  RETURN_IF_ERROR(CheckRange("min_mask_agreement", options.min_mask_agreement, 0.0, 1.0));
  RETURN_IF_ERROR(CheckRange("gate_layers", options.gate_layers, 1, 2));
  RETURN_IF_ERROR(CheckRange("num_neighbors", options.num_neighbors, 1, kMaxNeighbors));
  RETURN_IF_ERROR(
      CheckRange("num_drawn_neighbors", options.num_drawn_neighbors, 1, options.num_neighbors));
  RETURN_IF_ERROR(CheckRange("smooth_until", options.smooth_until, 0.0, 1.0));
  // Over 0, because the schedule is a power of learning_rate_final / learning_rate.
  RETURN_IF_ERROR(CheckRange("learning_rate", options.learning_rate, 1e-8f, 1.0f));
  RETURN_IF_ERROR(CheckRange("min_loss_fall", options.min_loss_fall, 0.0, 1.0));
  RETURN_IF_ERROR(CheckRange("sure_views", options.sure_views, 0, 64));
  RETURN_IF_ERROR(CheckRange("closing_share", options.closing_share, 0.0, 1.0));
  return CheckRange("steps_per_chunk", options.steps_per_chunk, 1, 100'000);
}

int NumSmoothedSteps(const FeatureOptions& options) {
  return static_cast<int>(std::lround(options.smooth_until * options.num_steps));
}

int NumGateNumbers(const FeatureOptions& options) {
  return options.gate_layers == 2 ? kTwoLayerGateSize : kGateSize;
}

}  // namespace pepeseg
