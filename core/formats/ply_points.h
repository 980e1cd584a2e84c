#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/scene/capture.h"

namespace pepeseg {

// The points of a PLY file: x, y, z, and red, green, blue of 0 to 255 if it has them (else grey).
// Relative to `origin`.
absl::StatusOr<std::vector<ScenePoint>> ReadPlyPoints(
    const std::filesystem::path& path, const std::string& name,
    const Eigen::Vector3d& origin = Eigen::Vector3d::Zero());

}  // namespace pepeseg
