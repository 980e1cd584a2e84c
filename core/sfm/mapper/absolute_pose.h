#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/sfm/mapper/global_model.h"

namespace pepeseg {

// A point in the world and where a photograph may show it, on the camera's plane z = 1.
struct PointSighting {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  Eigen::Vector2d seen = Eigen::Vector2d::Zero();
};

// Returns the poses from which three points are seen where they are, up to four. Solves Grunert's
// quartic for the ratio of two distances (Haralick et al. 1994, section 3.1). None for points on
// a line.
std::vector<CameraPose> SolveThreePoints(std::span<const PointSighting, 3> sightings);

// A pose and the sightings that it explains, ascending.
struct AbsolutePose {
  CameraPose pose;
  std::vector<uint32_t> inliers;
};

struct AbsolutePoseOptions {
  double max_error = 0.01;  // of an inlier on the plane z = 1
  int max_trials = 1000;
  uint64_t seed = 1;
};

// Finds the pose that explains most sightings: RANSAC over samples of three, each best pose
// refined by Gauss-Newton on its inliers. Nothing if no sample has a pose with four inliers.
std::optional<AbsolutePose> EstimateAbsolutePose(std::span<const PointSighting> sightings,
                                                 const AbsolutePoseOptions& options);

}  // namespace pepeseg
