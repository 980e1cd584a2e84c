#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/scene/camera.h"
#include "core/scene/capture.h"
#include "core/scene/lens.h"

namespace pepeseg {

// Limits of one file.
inline constexpr int64_t kMaxViews = 10'000;  // cameras, images
inline constexpr int64_t kMaxPoints = 50'000'000;

// A registered image of a COLMAP model. `name` is relative to COLMAP's folder of images.
struct ColmapImage {
  uint32_t id = 0;
  std::string name;
  uint32_t camera_id = 0;
  Pose cam_from_world;
};

struct ColmapCameras {
  std::map<uint32_t, Lens> by_id;
};

// Read COLMAP's three files: the text form if the suffix of `name` is .txt, else the binary form
// (little-endian). Tracks and 2D points are skipped; in images.txt an image may lack its line of 2D
// points. NOT_FOUND: there is no such file.
// INVALID_ARGUMENT, naming the file and the record: the file is cut short or malformed, a count
// exceeds the limits above or what the file can hold, a number is not finite, the camera model is
// unknown, an id or image name occurs twice, the norm of a rotation's quaternion is outside of
// [0.5, 2], or ValidateName refuses a name. Rotations are returned normalised.
absl::StatusOr<ColmapCameras> ReadColmapCameras(const std::filesystem::path& path,
                                                const std::string& name);
absl::StatusOr<std::vector<ColmapImage>> ReadColmapImages(const std::filesystem::path& path,
                                                          const std::string& name);
// Returns positions relative to `origin`: the subtraction is in double, the result in float.
absl::StatusOr<std::vector<ScenePoint>> ReadColmapPoints(
    const std::filesystem::path& path, const std::string& name,
    const Eigen::Vector3d& origin = Eigen::Vector3d::Zero());

}  // namespace pepeseg
