#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <span>

#include "core/scene/gaussians.h"

namespace pepeseg {

// p becomes pivot + scale * rotation * (p - pivot) + translation; scene units, relative to the
// model's origin.
struct Similarity {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();  // of length 1
  double scale = 1;                                              // > 0
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
  Eigen::Vector3d pivot = Eigen::Vector3d::Zero();
};

// Moves the Gaussians with the indices `rows`: means, standard deviations, rotations, and the
// colours by direction, whose spherical harmonics are rotated with them.
void MoveGaussians(const Similarity& move, std::span<const int64_t> rows, Gaussians& gaussians);

}  // namespace pepeseg
