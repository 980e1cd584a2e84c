#include "clients/cli/option_table.h"

#include <google/protobuf/descriptor.h>

#include "absl/strings/str_join.h"
#include "clients/cli/text_table.h"
#include "clients/cpp/option_setting.h"
#include "pepeseg/v1/training_options.pb.h"

namespace pepeseg::client::cli {
namespace {

// Ranges "0 to 1" are inclusive. option_table_test.cc compares every row with the server.
constexpr OptionRow kRows[] = {
    {"import.image_scale", "1", "0 to 1"},
    {"import.held_out_every", "8", "0, or 2 or more"},
    {"import.held_out_views", "", "name of a photograph, may be repeated"},
    {"import.use_masks", "true", "true or false"},
    {"import.use_depth", "true", "true or false"},
    {"reconstruct.num_steps", "10000", "1 to 10000000"},
    {"reconstruct.sh_degree", "3", "0 to 3"},
    {"reconstruct.ssim_weight", "0.2", "0 to 1"},
    {"reconstruct.mean_learning_rate", "0.00016", "1e-12 to 1"},
    {"reconstruct.mean_learning_rate_final", "1.6e-05", "1e-12 to 1"},
    {"reconstruct.log_scale_learning_rate", "0.005", "0 to 1"},
    {"reconstruct.rotation_learning_rate", "0.001", "0 to 1"},
    {"reconstruct.opacity_learning_rate", "0.05", "0 to 1"},
    {"reconstruct.sh_learning_rate", "0.0025", "0 to 1"},
    {"reconstruct.densify_from", "0.0166667", "0 to 1"},
    {"reconstruct.densify_until", "0.76", "0 to 1"},
    {"reconstruct.densify_every", "100", "1 to 1000000000"},
    {"reconstruct.densify_gradient", "0.0002", "0 to 1e9"},
    {"reconstruct.densify_size", "0.01", "0 to 1e9"},
    {"reconstruct.prune_opacity", "0.005", "0 to 0.5"},
    {"reconstruct.opacity_reset_every", "3000", "1 to 1000000000"},
    {"reconstruct.max_gaussians", "1000000", "1 to 100000000"},
    {"reconstruct.num_random_points", "20000", "1 to 10000000"},
    {"reconstruct.seed", "1", "0 to 18446744073709551615"},
    {"reconstruct.coarse_until", "0", "0 to 1"},
    {"reconstruct.max_megapixels", "0", "0 to 1e9"},
    {"reconstruct.pixels_per_gaussian", "50", "0 to 1e9"},
    {"reconstruct.opacity_decay", "0.95", "0.01 to 1"},
    {"reconstruct.camera_clearance", "0.3", "0 to 1"},
    {"reconstruct.dropout", "0.1", "0 to 0.9"},
    {"reconstruct.dropout_until", "0.8", "0 to 1"},
    {"reconstruct.blurred_share", "0.25", "0 to 1"},
    {"reconstruct.views_at_once", "0", "0 to 8"},
    {"reconstruct.depth_weight", "0", "0 to 10, or -1"},
    {"reconstruct.depth_weight_final", "0", "0 to 10"},
    {"reconstruct.depth_local_weight", "0.25", "0 to 10"},
    {"reconstruct.depth_local_form", "windows", ""},
    {"reconstruct.depth_window", "0.025", "0 to 0.5"},
    {"reconstruct.capture_kind", "unspecified", ""},
    {"reconstruct.refine_keep", "none", ""},
    {"reconstruct.refine_from", "0.133333", "0 to 1"},
    {"reconstruct.refine_length", "0.00666667", "0 to 1"},
    {"reconstruct.refine_candidates", "0.1", "0 to 1"},
    {"reconstruct.min_loss_fall", "0.01", "0 to 1"},
    {"reconstruct.closing_share", "0.2", "0 to 1"},
    {"reconstruct.min_band_gain", "0.1", "0 to 100"},
    {"reconstruct.min_depth_agreement", "0.5", "0 to 1"},
    {"reconstruct.mean_learning_rate_cap", "1", "0 to 1e9"},
    {"reconstruct.prune_size", "0.1", "0 to 1e9"},
    {"reconstruct.disparity_as_inverse_depth", "true", "true or false"},
    {"reconstruct.depth_over_alpha", "true", "true or false"},
    {"reconstruct.mean_rate_pixels", "0.06", "0 to 1"},
    {"reconstruct.rates_fall_from", "0.8", "0 to 1"},
    {"features.num_steps", "10000", "1 to 10000000"},
    {"features.num_pixels", "1000", "2 to 16384"},
    {"features.num_scales", "10", "1 to 16"},
    {"features.learning_rate", "0.01", "1e-8 to 1"},
    {"features.steps_per_chunk", "750", "1 to 100000"},
    {"features.seed", "1", "0 to 18446744073709551615"},
    {"features.num_neighbors", "4", "1 to 32"},
    {"features.num_drawn_neighbors", "2", "1 to features.num_neighbors"},
    {"features.learning_rate_final", "0.0001", "1e-8 to 1"},
    {"features.centroid_from", "0.7", "0 to 1"},
    {"features.centroid_every", "200", "1 to 10000000"},
    {"features.centroid_pixels", "16384", "1 to 65536"},
    {"features.centroid_weight_upper", "1", "0 to 100"},
    {"features.centroid_weight_lower", "0", "0 to 100"},
    {"features.num_background_pixels", "200", "0 to 16384"},
    {"features.perception_weight", "0.2", "0 to 100"},
    {"features.num_perception_pixels", "128", "1 to 16384"},
    {"features.perception_threshold", "differences", ""},
    {"features.perception_cross_view", "true", "true or false"},
    {"features.scale_mapping", "quantiles", ""},
    {"features.min_loss_fall", "0.01", "0 to 1"},
    {"features.closing_share", "0.5", "0 to 1"},
    {"features.mask_share", "0.25", "0 to 1"},
    {"features.sure_views", "8", "0 to 64"},
    {"features.min_mask_agreement", "0", "0 to 1"},
    {"features.complete_masks", "true", "true or false"},
    {"features.share_scales", "true", "true or false"},
    {"features.fine_first", "0.3", "0 to 0.9"},
    {"features.negative_margin", "0.2", "0 to 0.9"},
    {"features.min_positive_cosine", "0.9", "-1 to 1"},
    {"features.smooth_until", "0.5", "0 to 1"},
    {"features.gate_layers", "1", "1 to 2"},
    {"features.centroid_cosine_upper", "0.9", "0 to 0.9999"},
    {"features.centroid_cosine_lower", "0.97", "0 to 0.9999"},
    {"features.centroid_check_masks", "true", "true or false"},
    {"features.perception_fit_window", "true", "true or false"},
    {"features.perception_unlabelled_only", "true", "true or false"},
    {"features.perception_depth_floor", "0.005", "0 to 1"},
    {"features.perception_color_floor", "0.03", "0 to 1"},
    {"features.max_negative_cosine", "0.5", "-1 to 1"},
    {"features.joint_pair_mean", "false", "true or false"},
    {"features.min_norm_alpha", "0.9", "0 to 1"},
    {"features.centroid_views", "1", "1 to 1000"},
    {"features.centroid_masked_only", "true", "true or false"},
    {"features.centroid_merge_upper", "0.9", "0 to 0.9999"},
    {"features.centroid_merge_lower", "0.95", "0 to 0.9999"},
    {"sfm.matching", "unspecified", ""},
    {"sfm.max_features", "3000", "128 to 32768"},
    {"sfm.sequential_overlap", "10", "1 to 100"},
    {"sfm.min_registered_share", "0.5", "0 to 1"},
    {"sfm.max_seconds", "14400", "1 to 604800"},
    {"sfm.max_video_frames", "120", "3 to 2000"},
    {"sfm.front", "unspecified", ""},
    {"sfm.features", "unspecified", ""},
    {"sfm.mapper", "unspecified", ""},
    {"priors.masks", "unspecified", ""},
    {"priors.depth", "unspecified", ""},
    {"preset", "standard", ""},
};

// Returns the values of an enum option. "unspecified" is one of them only if it is the default: the
// server then decides.
std::vector<std::string> ValuesOf(const OptionRow& row) {
  std::vector<std::string> values = ValueNames(row.name, v1::TrainingOptions());
  if (row.default_value != std::string("unspecified")) std::erase(values, "unspecified");
  return values;
}

}  // namespace

std::span<const OptionRow> OptionRows() { return kRows; }

std::vector<std::string> OptionTable() {
  std::vector<TableRow> rows = {{"OPTION", "DEFAULT", "RANGE"}};
  for (const OptionRow& row : kRows) {
    std::string range = row.range;
    if (range.empty()) range = absl::StrJoin(ValuesOf(row), ", ");
    rows.push_back({row.name, row.default_value, range});
  }
  return TextTable(rows);
}

}  // namespace pepeseg::client::cli
