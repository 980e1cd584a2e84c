#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "core/sfm/mapper/tracks.h"

namespace pepeseg {

// A direction, in the world's axes, in which a camera sees a point.
struct WorldRay {
  uint32_t camera = 0, point = 0;
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();  // of length 1
};

struct PositionOptions {
  int max_steps = 100;
  uint64_t seed = 1;
  double huber = 0.1;  // residuals beyond it count linearly
};

struct GlobalPositions {
  std::vector<Eigen::Vector3d> cameras, points;
  double cost = 0;
};

// Finds the positions of cameras with known rotations together with points (GLOMAP, Pan et al.
// 2024, equation 4): minimises the sum of huber(|v - d (X - c)|) over cameras c, points X and one
// d >= 0 for each ray v, from random positions in [-1, 1]. Levenberg-Marquardt; d and X are
// eliminated, c is solved by a dense Cholesky decomposition. `rays` are sorted by point. Up to a
// similarity without rotation.
GlobalPositions FindPositions(int num_cameras, int num_points, std::span<const WorldRay> rays,
                              const PositionOptions& options);

// Returns by how much two sets of positions differ after the best translation and scale: the root
// mean square difference of those that `counts` over the root mean square radius of `a`.
double PositionDifference(std::span<const Eigen::Vector3d> a, std::span<const Eigen::Vector3d> b,
                          const std::vector<bool>& counts);

}  // namespace pepeseg
