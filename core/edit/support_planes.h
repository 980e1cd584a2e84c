#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "core/edit/thing_views.h"
#include "core/scene/gaussians.h"

namespace pepeseg {

// A flat surface next to a thing, such as the table that it stands on.
struct SupportPlane {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();    // the thing's center, projected onto it
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  // of length 1, towards the thing
  double tolerance = 0;  // largest distance of its Gaussians from it, scene units
  double spacing = 0;    // median size of its Gaussians, scene units

  // Returns the distance of a point from the plane; > 0: on the thing's side.
  double Above(const Eigen::Vector3d& p) const { return normal.dot(p - point); }
};

// Returns up to three planes, those with the most Gaussians first, found by RANSAC with a fixed
// seed among the Gaussians of `rest` next to the thing. All of the thing, or nearly, is on one side
// of each, and touches it. No two have nearly the same direction.
std::vector<SupportPlane> FindSupportPlanes(const Gaussians& gaussians, const GaussianSet& rest,
                                            std::span<const int64_t> thing,
                                            const ThingSpace& space);

}  // namespace pepeseg
