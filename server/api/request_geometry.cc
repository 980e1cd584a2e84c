#include "server/api/request_geometry.h"

#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/api/error.h"

namespace pepeseg {
namespace {

// Maximum number of pixels of a free camera, which bounds the memory of a render.
constexpr int64_t kMaxFreePixels = 16'000'000;
// Maximum number of points of a client's prompt: each takes a part of the time of a query. Core's
// limit is higher, for the clicks that an evaluation simulates (EvaluationOptions.clicks).
constexpr int kMaxRequestPoints = 64;
static_assert(kMaxRequestPoints <= kMaxPromptPoints);
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
  if (width < 1 || height < 1 || width > kMaxViewSide || height > kMaxViewSide ||
      width * height > kMaxFreePixels) {
    return BadGeometry(field, absl::StrCat(width, " x ", height, " pixels, allowed are 1..",
                                           kMaxViewSide, " each and ", kMaxFreePixels, " in all"));
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

// Makes INVALID_ARGUMENT such as "point 700,500 is outside photograph "a.jpg" (640x480)".
absl::Status BadPlace(const std::string& field, const std::string& value, const std::string& what,
                      const char* reason = "BAD_FIELD") {
  return WithDetail(absl::InvalidArgumentError(absl::StrCat(value, " ", what)),
                    {.reason = reason, .field = field, .limit = what, .value = value});
}

// Makes the error of a prompt inside the photograph but outside the undistorted view. Clients may
// catch it by its reason: the click was valid, but the model cannot know what is there.
absl::Status NotShown(const std::string& field, const std::string& value,
                      const ImageOfView& image) {
  return BadPlace(
      field, value,
      absl::StrCat("is in a part of ", image.name, " (", image.Size(),
                   ") that the model was not trained on: its lens was undistorted and the ",
                   "border cut off"),
      "NOTHING_THERE");
}

}  // namespace

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
  if (proto.points_size() < 1 || proto.points_size() > kMaxRequestPoints) {
    return bad_points(
        field + ".points",
        absl::StrCat(proto.points_size(), " points, allowed are 1..", kMaxRequestPoints));
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

absl::StatusOr<std::vector<PointPrompt>> ReadPoints(const v1::PointsPrompt& prompt,
                                                    const ImageOfView& image,
                                                    const std::string& field) {
  ASSIGN_OR_RETURN(std::vector<PointPrompt> points, PointsFromProto(prompt, field));
  for (size_t i = 0; i < points.size(); ++i) {
    PointPrompt& point = points[i];
    const std::string of_point = absl::StrCat(field, ".points[", i, "]");
    const std::string value = absl::StrCat("point ", point.x, ",", point.y);
    if (point.x < 0 || point.x >= image.frame.width() || point.y < 0 ||
        point.y >= image.frame.height()) {
      return BadPlace(of_point, value,
                      absl::StrCat("is outside ", image.name, " (", image.Size(), ")"));
    }
    // The frame is the view: its pixels are those of the prompt.
    if (image.frame.is_view()) continue;
    const auto in_view = image.frame.ToView(Eigen::Vector2d(point.x, point.y));
    if (!in_view) return NotShown(of_point, value, image);
    point.x = in_view->x();
    point.y = in_view->y();
  }
  return points;
}

absl::StatusOr<BoxPrompt> ReadBox(const v1::BoxPrompt& prompt, const ImageOfView& image,
                                  const std::string& field) {
  const BoxPrompt box{prompt.x(), prompt.y(), prompt.width(), prompt.height()};
  const std::string value =
      absl::StrCat("box ", box.x, ",", box.y, " ", box.width, "x", box.height);
  const bool finite = std::isfinite(box.x) && std::isfinite(box.y) && std::isfinite(box.width) &&
                      std::isfinite(box.height);
  if (!finite || box.width <= 0 || box.height <= 0) {
    return BadPlace(field, value, "is not finite, or is empty");
  }
  // A box may reach over the border, as one that is drawn by hand does, but not lie outside.
  if (box.x >= image.frame.width() || box.y >= image.frame.height() || box.x + box.width <= 0 ||
      box.y + box.height <= 0) {
    return BadPlace(field, value, absl::StrCat("is outside ", image.name, " (", image.Size(), ")"));
  }
  if (image.frame.is_view()) return box;
  const std::optional<BoxPrompt> in_view = image.frame.ToView(box);
  if (!in_view) return NotShown(field, value, image);
  return *in_view;
}

}  // namespace pepeseg
