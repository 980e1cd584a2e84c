#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"
#include "core/formats/colmap.h"

namespace pepeseg {

// What the binary and the text form share: the checks of a record. `where` names the file and the
// record in errors ("sparse/0/images.bin: image 3").

struct ColmapPose {
  double rotation[4] = {};  // w, x, y, z
  double translation[3] = {};
};
absl::StatusOr<Pose> CheckedPose(const ColmapPose& pose, const std::string& where);

absl::Status AddCamera(uint32_t id, const Lens& lens, const std::string& where,
                       ColmapCameras& cameras);
absl::Status AddImage(ColmapImage image, const ColmapPose& pose, const std::string& where,
                      std::vector<ColmapImage>& images);
// Kept relative to `origin`. `rgb` as written: 0..255. The error leaves it to the caller to say
// which point.
absl::Status AddPoint(const Eigen::Vector3d& xyz, const Eigen::Vector3d& origin,
                      const int (&rgb)[3], std::vector<ScenePoint>& points);
// No two images may have the same id or name.
absl::Status CheckUnique(const std::vector<ColmapImage>& images, const std::string& name);

// The two forms of each file, of its bytes.
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
