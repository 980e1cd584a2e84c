#include "server/api/convert.h"

#include <string>
#include <type_traits>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"

// Each option is named once, for both directions: it has the same name in the message and in the
// struct. A test proves that no field is missing.
#define PEPESEG_IMPORT_FIELDS(FIELD) \
  FIELD(image_scale) FIELD(held_out_every) FIELD(use_masks) FIELD(use_depth)
#define PEPESEG_PRIOR_FIELDS(FIELD) FIELD(masks) FIELD(depth)
// (clang-format formats lists of this length differently each time.)
// clang-format off
#define PEPESEG_SFM_FIELDS(FIELD) \
  FIELD(matching) FIELD(max_features) FIELD(sequential_overlap) \
  FIELD(min_registered_share) FIELD(max_seconds) FIELD(max_video_frames) FIELD(front) \
  FIELD(features) FIELD(mapper)
#define PEPESEG_RECONSTRUCT_FIELDS(FIELD) \
  FIELD(num_steps) \
  FIELD(sh_degree) \
  FIELD(ssim_weight) \
  FIELD(mean_learning_rate) \
  FIELD(mean_learning_rate_final) \
  FIELD(mean_rate_pixels) \
  FIELD(rates_fall_from) \
  FIELD(log_scale_learning_rate) \
  FIELD(rotation_learning_rate) \
  FIELD(opacity_learning_rate) \
  FIELD(sh_learning_rate) \
  FIELD(densify_from) \
  FIELD(densify_until) \
  FIELD(densify_every) \
  FIELD(densify_gradient) \
  FIELD(densify_size) \
  FIELD(prune_opacity) \
  FIELD(opacity_reset_every) \
  FIELD(max_gaussians) \
  FIELD(num_random_points) \
  FIELD(seed) \
  FIELD(coarse_until) \
  FIELD(max_megapixels) \
  FIELD(depth_weight) \
  FIELD(depth_weight_final) \
  FIELD(depth_local_weight) \
  FIELD(depth_local_form) \
  FIELD(depth_window) \
  FIELD(capture_kind) \
  FIELD(refine_keep) \
  FIELD(refine_from) \
  FIELD(refine_length) \
  FIELD(refine_candidates) \
  FIELD(min_loss_fall) \
  FIELD(closing_share) \
  FIELD(min_band_gain) \
  FIELD(min_depth_agreement) \
  FIELD(pixels_per_gaussian) \
  FIELD(opacity_decay) \
  FIELD(camera_clearance) \
  FIELD(dropout) \
  FIELD(dropout_until) \
  FIELD(blurred_share) \
  FIELD(views_at_once) \
  FIELD(mean_learning_rate_cap) \
  FIELD(prune_size) \
  FIELD(disparity_as_inverse_depth) \
  FIELD(depth_over_alpha)
#define PEPESEG_FEATURE_FIELDS(FIELD) \
  FIELD(num_steps) \
  FIELD(num_pixels) \
  FIELD(mask_share) \
  FIELD(sure_views) \
  FIELD(min_mask_agreement) \
  FIELD(complete_masks) \
  FIELD(share_scales) \
  FIELD(fine_first) \
  FIELD(negative_margin) \
  FIELD(min_positive_cosine) \
  FIELD(num_background_pixels) \
  FIELD(num_scales) \
  FIELD(scale_mapping) \
  FIELD(learning_rate) \
  FIELD(learning_rate_final) \
  FIELD(num_neighbors) \
  FIELD(smooth_until) \
  FIELD(num_drawn_neighbors) \
  FIELD(centroid_from) \
  FIELD(centroid_every) \
  FIELD(centroid_pixels) \
  FIELD(centroid_weight_upper) \
  FIELD(centroid_weight_lower) \
  FIELD(perception_weight) \
  FIELD(num_perception_pixels) \
  FIELD(perception_threshold) \
  FIELD(perception_cross_view) \
  FIELD(steps_per_chunk) \
  FIELD(min_loss_fall) \
  FIELD(closing_share) \
  FIELD(seed) \
  FIELD(gate_layers) \
  FIELD(centroid_cosine_upper) \
  FIELD(centroid_cosine_lower) \
  FIELD(centroid_check_masks) \
  FIELD(perception_fit_window) \
  FIELD(perception_unlabelled_only) \
  FIELD(perception_depth_floor) \
  FIELD(perception_color_floor) \
  FIELD(max_negative_cosine) \
  FIELD(joint_pair_mean) \
  FIELD(min_norm_alpha) \
  FIELD(centroid_views) \
  FIELD(centroid_masked_only) \
  FIELD(centroid_merge_upper) \
  FIELD(centroid_merge_lower)
// clang-format on

// The casts are for enums, which have the same numbers in the message and in the struct.
#define PEPESEG_OVERLAY(name)                    \
  if (IsGiven(proto.has_##name(), proto.name())) \
    options->name = static_cast<decltype(options->name)>(proto.name());
#define PEPESEG_SET(name) proto->set_##name(static_cast<decltype(proto->name())>(options.name));

namespace pepeseg {
namespace {

// UNSPECIFIED, the zero of an enum, means the default, as if the field were absent. The zero of a
// number is a value.
template <typename Value>
bool IsGiven(bool present, Value value) {
  if constexpr (std::is_enum_v<Value>) return present && static_cast<int>(value) != 0;
  return present;
}

void OverlayImport(const v1::ImportOptions& proto, ImportOptions* options) {
  PEPESEG_IMPORT_FIELDS(PEPESEG_OVERLAY)
  // A repeated field is given if it is not empty.
  if (proto.held_out_views().empty()) return;
  options->held_out_views.assign(proto.held_out_views().begin(), proto.held_out_views().end());
}
void OverlayPriors(const v1::PriorOptions& proto, PriorOptions* options) {
  PEPESEG_PRIOR_FIELDS(PEPESEG_OVERLAY)
}
void OverlaySfm(const v1::SfmOptions& proto, SfmOptions* options) {
  PEPESEG_SFM_FIELDS(PEPESEG_OVERLAY)
}
void OverlayReconstruct(const v1::ReconstructOptions& proto, ReconstructOptions* options) {
  PEPESEG_RECONSTRUCT_FIELDS(PEPESEG_OVERLAY)
}
void OverlayFeatures(const v1::FeatureOptions& proto, FeatureOptions* options) {
  PEPESEG_FEATURE_FIELDS(PEPESEG_OVERLAY)
}
void SetImport(const ImportOptions& options, v1::ImportOptions* proto) {
  PEPESEG_IMPORT_FIELDS(PEPESEG_SET)
  for (const std::string& view : options.held_out_views) proto->add_held_out_views(view);
}
void SetPriors(const PriorOptions& options, v1::PriorOptions* proto) {
  PEPESEG_PRIOR_FIELDS(PEPESEG_SET)
}
void SetSfm(const SfmOptions& options, v1::SfmOptions* proto) { PEPESEG_SFM_FIELDS(PEPESEG_SET) }
void SetReconstruct(const ReconstructOptions& options, v1::ReconstructOptions* proto) {
  PEPESEG_RECONSTRUCT_FIELDS(PEPESEG_SET)
}
void SetFeatures(const FeatureOptions& options,
                 v1::FeatureOptions* proto){PEPESEG_FEATURE_FIELDS(PEPESEG_SET)}

// Puts the name of the options' message before the error of a stage.
absl::Status Below(const std::string& message, const absl::Status& status) {
  if (status.ok()) return status;
  return {status.code(), absl::StrCat("options.", message, ": ", status.message())};
}

}  // namespace

void Overlay(const v1::TrainingOptions& proto, TrainingSettings* settings) {
  if (IsGiven(proto.has_preset(), proto.preset())) {
    settings->preset = static_cast<Preset>(proto.preset());
  }
  // The preset comes first, so that options that are given override it.
  Apply(settings->preset, settings->reconstruct, settings->features);
  OverlayImport(proto.import(), &settings->import);
  OverlayPriors(proto.priors(), &settings->priors);
  OverlaySfm(proto.sfm(), &settings->sfm);
  OverlayReconstruct(proto.reconstruct(), &settings->reconstruct);
  OverlayFeatures(proto.features(), &settings->features);
}

absl::StatusOr<TrainingSettings> TrainingSettingsFromProto(const v1::TrainingOptions& proto) {
  TrainingSettings settings;
  Overlay(proto, &settings);
  RETURN_IF_ERROR(Below("preset", Validate(settings.preset)));
  RETURN_IF_ERROR(Below("import", Validate(settings.import)));
  RETURN_IF_ERROR(Below("priors", Validate(settings.priors)));
  RETURN_IF_ERROR(Below("sfm", Validate(settings.sfm)));
  RETURN_IF_ERROR(Below("reconstruct", Validate(settings.reconstruct)));
  RETURN_IF_ERROR(Below("features", Validate(settings.features)));
  return settings;
}

v1::TrainingOptions ToProto(const TrainingSettings& settings) {
  v1::TrainingOptions proto;
  proto.set_preset(static_cast<v1::TrainingPreset>(settings.preset));
  SetImport(settings.import, proto.mutable_import());
  SetPriors(settings.priors, proto.mutable_priors());
  SetSfm(settings.sfm, proto.mutable_sfm());
  SetReconstruct(settings.reconstruct, proto.mutable_reconstruct());
  SetFeatures(settings.features, proto.mutable_features());
  return proto;
}

absl::StatusOr<FileKind> FileKindFromProto(v1::FileKind kind) {
  switch (kind) {
    case v1::FILE_KIND_IMAGE:
      return FileKind::kImage;
    case v1::FILE_KIND_POSES:
      return FileKind::kPoses;
    case v1::FILE_KIND_MASK:
      return FileKind::kMask;
    case v1::FILE_KIND_IGNORE_MASK:
      return FileKind::kIgnoreMask;
    case v1::FILE_KIND_DEPTH:
      return FileKind::kDepth;
    case v1::FILE_KIND_DISPARITY:
      return FileKind::kDisparity;
    case v1::FILE_KIND_POINTS:
      return FileKind::kPoints;
    case v1::FILE_KIND_GAUSSIANS:
      return FileKind::kGaussians;
    case v1::FILE_KIND_VIDEO:
      return FileKind::kVideo;
    default:
      return absl::InvalidArgumentError(
          absl::StrCat("kind: ", static_cast<int>(kind), " is no kind of file"));
  }
}

google::protobuf::Timestamp ToProto(absl::Time time) {
  google::protobuf::Timestamp proto;
  const int64_t nanos = absl::ToUnixNanos(time);
  proto.set_seconds(nanos / 1'000'000'000);
  proto.set_nanos(static_cast<int32_t>(nanos % 1'000'000'000));
  return proto;
}

google::protobuf::Duration ToProto(absl::Duration duration) {
  google::protobuf::Duration proto;
  const int64_t nanos = absl::ToInt64Nanoseconds(duration);
  proto.set_seconds(nanos / 1'000'000'000);
  proto.set_nanos(static_cast<int32_t>(nanos % 1'000'000'000));
  return proto;
}

v1::Vector3 VectorToProto(const std::array<double, 3>& vector) {
  v1::Vector3 proto;
  proto.set_x(vector[0]);
  proto.set_y(vector[1]);
  proto.set_z(vector[2]);
  return proto;
}

v1::View ToProto(const ModelView& view) {
  v1::View proto;
  proto.set_view(view.name);
  v1::PinholeCamera& camera = *proto.mutable_camera();
  camera.set_width(view.camera.width);
  camera.set_height(view.camera.height);
  camera.set_fx(view.camera.fx);
  camera.set_fy(view.camera.fy);
  camera.set_cx(view.camera.cx);
  camera.set_cy(view.camera.cy);
  v1::RigidTransform& pose = *proto.mutable_cam_from_world();
  const Eigen::Quaterniond& q = view.cam_from_world.rotation;
  v1::Quaternion& rotation = *pose.mutable_rotation();
  rotation.set_w(q.w());
  rotation.set_x(q.x());
  rotation.set_y(q.y());
  rotation.set_z(q.z());
  const Eigen::Vector3d& t = view.cam_from_world.translation;
  *pose.mutable_translation() = VectorToProto({t.x(), t.y(), t.z()});
  proto.set_held_out(view.held_out);
  const auto& photograph = view.photograph;
  // A model of an older version has no photographs: its views are then the only frame.
  proto.set_photograph_width(photograph ? photograph->UprightWidth() : view.camera.width);
  proto.set_photograph_height(photograph ? photograph->UprightHeight() : view.camera.height);
  if (view.scores) *proto.mutable_scores() = ToProto(*view.scores);
  return proto;
}

v1::ImageScores ToProto(const ImageScores& scores) {
  v1::ImageScores proto;
  proto.set_psnr(scores.psnr);
  proto.set_ssim(scores.ssim);
  if (scores.lpips) proto.set_lpips(*scores.lpips);
  return proto;
}

}  // namespace pepeseg
