#include "server/api/convert.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/store/error_detail.h"

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

absl::Status BadGeometry(const std::string& field, const std::string& what) {
  return WithDetail(absl::InvalidArgumentError(absl::StrCat(field, ": ", what)),
                    {.reason = "BAD_FIELD", .field = field});
}

absl::Status CheckCamera(const v1::PinholeCamera& camera, const std::string& field) {
  const int64_t width = camera.width();
  const int64_t height = camera.height();
  if (width < 1 || height < 1 || width > kMaxExtent || height > kMaxExtent ||
      width * height > kMaxPixels) {
    return BadGeometry(field, absl::StrCat(width, " x ", height, " pixels, allowed are 1..",
                                           kMaxExtent, " each and ", kMaxPixels, " in all"));
  }
  for (const auto& [name, focal] : {std::pair{"fx", camera.fx()}, {"fy", camera.fy()}}) {
    if (!std::isfinite(focal) || focal <= 0) {
      return BadGeometry(absl::StrCat(field, ".", name),
                         absl::StrCat(focal, " is not finite and > 0"));
    }
  }
  for (const auto& [name, centre] : {std::pair{"cx", camera.cx()}, {"cy", camera.cy()}}) {
    if (!std::isfinite(centre)) {
      return BadGeometry(absl::StrCat(field, ".", name), absl::StrCat(centre, " is not finite"));
    }
  }
  return absl::OkStatus();
}

// Returns INVALID_ARGUMENT unless all values are finite. NaN would pass comparisons of ranges
// further on.
absl::Status CheckFinite(std::initializer_list<std::pair<const char*, double>> values,
                         const std::string& field) {
  for (const auto& [name, value] : values) {
    if (std::isfinite(value)) continue;
    return BadGeometry(absl::StrCat(field, ".", name), absl::StrCat(value, " is not finite"));
  }
  return absl::OkStatus();
}

absl::StatusOr<Eigen::Quaterniond> RotationFromProto(const v1::Quaternion& q,
                                                     const std::string& field) {
  RETURN_IF_ERROR(CheckFinite({{"w", q.w()}, {"x", q.x()}, {"y", q.y()}, {"z", q.z()}}, field));
  const Eigen::Quaterniond rotation(q.w(), q.x(), q.y(), q.z());
  const double norm = rotation.norm();
  if (std::abs(norm - 1) > kMaxNormError) {
    return BadGeometry(field, absl::StrCat("norm ", norm, " instead of 1 within ", kMaxNormError));
  }
  return rotation.normalized();
}

absl::StatusOr<Pose> PoseFromProto(const v1::RigidTransform& proto, const std::string& field) {
  const std::string rotation_field = absl::StrCat(field, ".rotation");
  const std::string translation_field = absl::StrCat(field, ".translation");
  if (!proto.has_rotation()) return BadGeometry(rotation_field, "is required");
  if (!proto.has_translation()) return BadGeometry(translation_field, "is required");
  Pose pose;
  ASSIGN_OR_RETURN(pose.rotation, RotationFromProto(proto.rotation(), rotation_field));
  const v1::Vector3& t = proto.translation();
  RETURN_IF_ERROR(CheckFinite({{"x", t.x()}, {"y", t.y()}, {"z", t.z()}}, translation_field));
  pose.translation = Eigen::Vector3d(t.x(), t.y(), t.z());
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

absl::StatusOr<ModelView> FreeViewFromProto(const v1::Viewpoint::FreeCamera& proto,
                                            const std::string& field) {
  RETURN_IF_ERROR(CheckCamera(proto.camera(), field + ".camera"));
  ModelView view;
  ASSIGN_OR_RETURN(view.cam_from_world,
                   PoseFromProto(proto.cam_from_world(), field + ".cam_from_world"));
  const v1::PinholeCamera& camera = proto.camera();
  view.camera = {camera.width(), camera.height(), camera.fx(),
                 camera.fy(),    camera.cx(),     camera.cy()};
  return view;
}

absl::StatusOr<std::vector<PointPrompt>> PointsFromProto(const v1::PointsPrompt& proto,
                                                         const std::string& field) {
  const auto bad_points = [](const std::string& name, const std::string& what) {
    return WithDetail(absl::InvalidArgumentError(absl::StrCat(name, ": ", what)),
                      {.reason = "BAD_FIELD", .field = name});
  };
  if (proto.points_size() < 1 || proto.points_size() > kMaxPoints) {
    return bad_points(field + ".points",
                      absl::StrCat(proto.points_size(), " points, allowed are 1..", kMaxPoints));
  }
  std::vector<PointPrompt> points;
  bool any_positive = false;
  for (const v1::PointsPrompt::Point& point : proto.points()) {
    if (!std::isfinite(point.x()) || !std::isfinite(point.y())) {
      return bad_points(absl::StrCat(field, ".points[", points.size(), "]"),
                        absl::StrCat("(", point.x(), ", ", point.y(), ") is not finite"));
    }
    points.push_back({point.x(), point.y(), !point.negative()});
    any_positive |= !point.negative();
  }
  // Negative points only take away from what positive ones select.
  if (!any_positive) return bad_points(field + ".points", "no positive point among them");
  return points;
}

}  // namespace pepeseg
