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

inline constexpr int64_t kMaxViews = 10'000;
inline constexpr int64_t kMaxPoints = 50'000'000;

// A view as COLMAP knows it; the name is relative to its folder of images.
struct ColmapImage {
  uint32_t id = 0;
  std::string name;
  uint32_t camera_id = 0;
  Pose cam_from_world;
};

struct ColmapCameras {
  std::map<uint32_t, Lens> by_id;
};

// COLMAP's three files, in its binary (little-endian) or its text form, told apart by the suffix
// of `name`. Their tracks and 2D points are passed over. INVALID_ARGUMENT names the file and the
// record: cut short, malformed, a count that the file cannot hold or over the limits above, a
// number that is not finite, a camera model that is not COLMAP's, an id that occurs twice, a
// rotation that is no unit quaternion, a name that ValidateName refuses.
absl::StatusOr<ColmapCameras> ReadColmapCameras(const std::filesystem::path& path,
                                                const std::string& name);
absl::StatusOr<std::vector<ColmapImage>> ReadColmapImages(const std::filesystem::path& path,
                                                          const std::string& name);
// Relative to `origin`.
absl::StatusOr<std::vector<ScenePoint>> ReadColmapPoints(
    const std::filesystem::path& path, const std::string& name,
    const Eigen::Vector3d& origin = Eigen::Vector3d::Zero());

}  // namespace pepeseg
