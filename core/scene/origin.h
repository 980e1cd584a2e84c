#pragma once

#include <Eigen/Core>
#include <span>

#include "core/scene/camera.h"

namespace pepeseg {

// Where a scene's coordinates are counted from. Single precision holds seven digits: far from zero
// (map coordinates, say) they would not tell the scene's parts apart, so a capture and its model
// are relative to an origin, and what leaves them (poses, PLY) is in the world of the dataset
// again.

// Zero, or the middle of the cameras where it is a hundred times as far from zero as the cameras
// are from it.
Eigen::Vector3d OriginOf(std::span<const Pose> cams_from_world);

// The same pose for coordinates that are counted from `origin`, and back.
Pose RelativeTo(const Eigen::Vector3d& origin, const Pose& cam_from_world);
Pose InWorld(const Eigen::Vector3d& origin, const Pose& cam_from_origin);

}  // namespace pepeseg
