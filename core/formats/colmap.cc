#include "core/formats/colmap.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/errors.h"
#include "core/base/file_io.h"
#include "core/base/file_name.h"
#include "core/base/status_macros.h"
#include "core/formats/colmap_records.h"

namespace pepeseg {
namespace {

// images.bin has 24 bytes for each 2D point, and thousands of those for each view.
constexpr int64_t kMaxFileBytes = int64_t{16} << 30;

bool AllFinite(const double* values, int count) {
  return std::all_of(values, values + count, [](double v) { return std::isfinite(v); });
}

// Reads the file and calls the parser for the suffix of `name`.
template <class Result>
absl::StatusOr<Result> ReadEither(const std::filesystem::path& path, const std::string& name,
                                  absl::StatusOr<Result> (*binary)(absl::string_view,
                                                                   const std::string&),
                                  absl::StatusOr<Result> (*text)(absl::string_view,
                                                                 const std::string&)) {
  ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path, name, kMaxFileBytes));
  return Suffix(name) == ".txt" ? text(bytes, name) : binary(bytes, name);
}

}  // namespace

absl::StatusOr<Pose> CheckedPose(const ColmapPose& pose, const std::string& where) {
  // COLMAP writes unit quaternions. A norm far from 1 means that the file is damaged or that the
  // numbers are not a quaternion.
  constexpr double kLeastNorm = 0.5;
  constexpr double kMostNorm = 2;
  constexpr double kMostDistance = 1e12;
  if (!AllFinite(pose.rotation, 4) || !AllFinite(pose.translation, 3)) {
    return Refused(where, "the pose is not finite");
  }
  // COLMAP stores w first, as Eigen's constructor takes it. The pose maps world to camera.
  const Eigen::Quaterniond rotation(pose.rotation[0], pose.rotation[1], pose.rotation[2],
                                    pose.rotation[3]);
  const double norm = rotation.norm();
  // Negated, so that a NaN fails, too.
  if (!(norm >= kLeastNorm && norm <= kMostNorm)) {
    return Refused(where, absl::StrCat("the rotation's quaternion has the norm ", norm));
  }
  const Eigen::Vector3d translation(pose.translation);
  if (!(translation.norm() <= kMostDistance)) {
    return Refused(where, absl::StrCat("the translation is longer than ", kMostDistance));
  }
  return Pose{rotation.normalized(), translation};
}

absl::Status AddCamera(uint32_t id, const Lens& lens, const std::string& where,
                       ColmapCameras& cameras) {
  const absl::Status valid = Validate(lens);
  if (!valid.ok()) return Refused(where, valid.message());
  if (!cameras.by_id.try_emplace(id, lens).second) {
    return Refused(where, absl::StrCat("the camera id ", id, " occurs twice"));
  }
  return absl::OkStatus();
}

absl::Status AddImage(ColmapImage image, const ColmapPose& pose, const std::string& where,
                      std::vector<ColmapImage>& images) {
  const absl::Status valid = ValidateName(image.name);
  if (!valid.ok()) return Refused(where, valid.message());
  // From here on errors name the image, not only its index.
  const std::string named = absl::StrCat(where, " (", image.name, ")");
  ASSIGN_OR_RETURN(image.cam_from_world, CheckedPose(pose, named));
  images.push_back(std::move(image));
  return absl::OkStatus();
}

absl::Status AddPoint(const Eigen::Vector3d& xyz, const Eigen::Vector3d& origin,
                      const int (&rgb)[3], std::vector<ScenePoint>& points) {
  constexpr double kMostDistance = 1e12;
  ScenePoint point;
  for (int i = 0; i < 3; ++i) {
    // Written so that NaN is refused.
    if (!(std::abs(xyz[i]) <= kMostDistance)) {
      return absl::InvalidArgumentError("the position is not finite, or beyond 1e12");
    }
    if (rgb[i] < 0 || rgb[i] > 255) {
      return absl::InvalidArgumentError("the colour is not in 0 to 255");
    }
    // The subtraction is in double: coordinates far from zero lose their digits in float.
    point.position[i] = static_cast<float>(xyz[i] - origin[i]);
    point.rgb[i] = static_cast<uint8_t>(rgb[i]);
  }
  points.push_back(point);
  return absl::OkStatus();
}

// Only images need this check: AddCamera finds equal ids, and points have no names.
absl::Status CheckUnique(const std::vector<ColmapImage>& images, const std::string& name) {
  std::set<uint32_t> ids;
  std::set<absl::string_view> names;
  for (const ColmapImage& image : images) {
    if (!ids.insert(image.id).second) {
      return Refused(name, absl::StrCat("the image id ", image.id, " occurs twice"));
    }
    if (!names.insert(image.name).second) {
      return Refused(name, absl::StrCat("the image ", image.name, " occurs twice"));
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<ColmapCameras> ReadColmapCameras(const std::filesystem::path& path,
                                                const std::string& name) {
  return ReadEither<ColmapCameras>(path, name, ParseCamerasBinary, ParseCamerasText);
}

absl::StatusOr<std::vector<ColmapImage>> ReadColmapImages(const std::filesystem::path& path,
                                                          const std::string& name) {
  ASSIGN_OR_RETURN(
      std::vector<ColmapImage> images,
      ReadEither<std::vector<ColmapImage>>(path, name, ParseImagesBinary, ParseImagesText));
  RETURN_IF_ERROR(CheckUnique(images, name));
  return images;
}

absl::StatusOr<std::vector<ScenePoint>> ReadColmapPoints(const std::filesystem::path& path,
                                                         const std::string& name,
                                                         const Eigen::Vector3d& origin) {
  ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path, name, kMaxFileBytes));
  return Suffix(name) == ".txt" ? ParsePointsText(bytes, name, origin)
                                : ParsePointsBinary(bytes, name, origin);
}

}  // namespace pepeseg
