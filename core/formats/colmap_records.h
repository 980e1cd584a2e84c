#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"
#include "core/formats/colmap.h"

namespace pepeseg {

// Shared by the parsers of the binary and the text form: the checks of one record. `where` names
// the file and the record in errors ("sparse/0/images.bin: image 3"). Private to colmap*.cc.

struct ColmapPose {
  double rotation[4] = {};  // w, x, y, z
  double translation[3] = {};
};
// Returns the pose with its rotation normalised, or INVALID_ARGUMENT if it is not finite, its
// quaternion is far from unit length, or its translation exceeds 1e12.
absl::StatusOr<Pose> CheckedPose(const ColmapPose& pose, const std::string& where);

// Check a record and append it. INVALID_ARGUMENT: the lens is invalid (Validate), the camera id
// occurs twice, the image name is invalid (ValidateName), or the pose is.
absl::Status AddCamera(uint32_t id, const Lens& lens, const std::string& where,
                       ColmapCameras& cameras);
absl::Status AddImage(ColmapImage image, const ColmapPose& pose, const std::string& where,
                      std::vector<ColmapImage>& images);
// Checks a point and appends it relative to `origin`. INVALID_ARGUMENT: a coordinate is not finite
// or beyond 1e12, or a channel of `rgb` is outside of [0, 255]. The message does not name the
// point: building names for 50 million valid points would be slow, so the caller adds it to an
// error.
absl::Status AddPoint(const Eigen::Vector3d& xyz, const Eigen::Vector3d& origin,
                      const int (&rgb)[3], std::vector<ScenePoint>& points);
// Returns INVALID_ARGUMENT if two images have the same id or name.
absl::Status CheckUnique(const std::vector<ColmapImage>& images, const std::string& name);

// Parse the bytes of one file in either form.
absl::StatusOr<ColmapCameras> ParseCamerasBinary(absl::string_view bytes, const std::string& name);
absl::StatusOr<ColmapCameras> ParseCamerasText(absl::string_view text, const std::string& name);
absl::StatusOr<std::vector<ColmapImage>> ParseImagesBinary(absl::string_view bytes,
                                                           const std::string& name);
absl::StatusOr<std::vector<ColmapImage>> ParseImagesText(absl::string_view text,
                                                         const std::string& name);
absl::StatusOr<std::vector<ScenePoint>> ParsePointsBinary(absl::string_view bytes,
                                                          const std::string& name,
                                                          const Eigen::Vector3d& origin);
absl::StatusOr<std::vector<ScenePoint>> ParsePointsText(absl::string_view text,
                                                        const std::string& name,
                                                        const Eigen::Vector3d& origin);

}  // namespace pepeseg
