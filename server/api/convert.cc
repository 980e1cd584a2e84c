#include "server/api/convert.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

// Limits of a free camera: they bound the memory of a render, as those of files bound views.
constexpr int kMaxExtent = 16384;
constexpr int64_t kMaxPixels = 16'000'000;
// Maximum number of points of a prompt: each takes a part of the time of a query.
constexpr int kMaxPoints = 64;
// Clients send quaternions in decimal or single precision, so a small error of the norm is accepted
// and corrected.
constexpr double kMaxNormError = 1e-3;

absl::Status CheckCamera(const v1::PinholeCamera& camera, const std::string& field) {
  const int64_t width = camera.width();
  const int64_t height = camera.height();
  if (width < 1 || height < 1 || width > kMaxExtent || height > kMaxExtent ||
      width * height > kMaxPixels) {
    return absl::InvalidArgumentError(absl::StrCat(field, ".camera: ", width, " x ", height,
                                                   " pixels, allowed are 1..", kMaxExtent,
                                                   " each and ", kMaxPixels, " in all"));
  }
  for (const auto& [name, focal] : {std::pair{"fx", camera.fx()}, {"fy", camera.fy()}}) {
    if (!std::isfinite(focal) || focal <= 0) {
      return absl::InvalidArgumentError(
          absl::StrCat(field, ".camera.", name, ": ", focal, " is not finite and > 0"));
    }
  }
  for (const auto& [name, centre] : {std::pair{"cx", camera.cx()}, {"cy", camera.cy()}}) {
    if (!std::isfinite(centre)) {
      return absl::InvalidArgumentError(
          absl::StrCat(field, ".camera.", name, ": ", centre, " is not finite"));
    }
  }
  return absl::OkStatus();
}

// Returns INVALID_ARGUMENT unless there are `size` finite values. NaN would pass comparisons of
// ranges further on.
absl::Status CheckVector(const google::protobuf::RepeatedField<double>& values, int size,
                         const std::string& field) {
  if (values.size() != size) {
    return absl::InvalidArgumentError(
        absl::StrCat(field, ": ", values.size(), " values instead of ", size));
  }
  for (int i = 0; i < size; ++i) {
    if (!std::isfinite(values[i])) {
      return absl::InvalidArgumentError(
          absl::StrCat(field, "[", i, "]: ", values[i], " is not finite"));
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<Pose> PoseFromProto(const v1::RigidTransform& proto, const std::string& field) {
  const std::string rotation_field = absl::StrCat(field, ".cam_from_world.rotation");
  RETURN_IF_ERROR(CheckVector(proto.rotation(), 4, rotation_field));
  RETURN_IF_ERROR(
      CheckVector(proto.translation(), 3, absl::StrCat(field, ".cam_from_world.translation")));
  const auto& q = proto.rotation();
  const auto& t = proto.translation();
  // Both the message and Eigen's constructor have w first.
  Pose pose{Eigen::Quaterniond(q[0], q[1], q[2], q[3]), Eigen::Vector3d(t[0], t[1], t[2])};
  const double norm = pose.rotation.norm();
  if (std::abs(norm - 1) > kMaxNormError) {
    return absl::InvalidArgumentError(
        absl::StrCat(rotation_field, ": norm ", norm, " instead of 1 within ", kMaxNormError));
  }
  pose.rotation.normalize();
  return pose;
}

}  // namespace

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
  for (double value : {q.w(), q.x(), q.y(), q.z()}) pose.add_rotation(value);
  for (double value : view.cam_from_world.translation) pose.add_translation(value);
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

absl::StatusOr<ModelView> FreeViewFromProto(const v1::Viewpoint::FreeCamera& proto,
                                            const std::string& field) {
  RETURN_IF_ERROR(CheckCamera(proto.camera(), field));
  ModelView view;
  ASSIGN_OR_RETURN(view.cam_from_world, PoseFromProto(proto.cam_from_world(), field));
  const v1::PinholeCamera& camera = proto.camera();
  view.camera = {camera.width(), camera.height(), camera.fx(),
                 camera.fy(),    camera.cx(),     camera.cy()};
  return view;
}

absl::StatusOr<std::vector<PointPrompt>> PointsFromProto(const v1::PointsPrompt& proto) {
  if (proto.points_size() < 1 || proto.points_size() > kMaxPoints) {
    return absl::InvalidArgumentError(absl::StrCat("points.points: ", proto.points_size(),
                                                   " points, allowed are 1..", kMaxPoints));
  }
  std::vector<PointPrompt> points;
  bool any_positive = false;
  for (const v1::PointsPrompt::Point& point : proto.points()) {
    if (!std::isfinite(point.x()) || !std::isfinite(point.y())) {
      return absl::InvalidArgumentError(absl::StrCat(
          "points.points[", points.size(), "]: (", point.x(), ", ", point.y(), ") is not finite"));
    }
    points.push_back({point.x(), point.y(), !point.negative()});
    any_positive |= !point.negative();
  }
  if (!any_positive) {
    // Negative points only take away from what positive ones select.
    return absl::InvalidArgumentError("points.points: no positive point among them");
  }
  return points;
}

}  // namespace pepeseg
