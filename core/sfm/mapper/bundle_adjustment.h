#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "core/sfm/mapper/global_model.h"
#include "kernels/thread_pool.h"

namespace pepeseg {

struct BundleOptions {
  int max_steps = 20;
  bool fix_rotations = false;
  bool fix_lenses = false;  // focal length, k1 and principal point
  // By camera group: the principal point changes as well. Empty: none does.
  std::vector<bool> free_centres;
  double loss_scale = 1;       // pixels: soft L1, 2 s^2 (sqrt(1 + r^2 / s^2) - 1)
  double min_decrease = 1e-5;  // ends when the cost falls by less than this share
};

struct BundleSummary {
  double first_cost = 0, last_cost = 0;
  int num_steps = 0;
  // By camera group: standard deviations of the principal point, pixels, from the curvature of the
  // cost at its minimum; errors of features count as independent. Infinite where it was not free.
  std::vector<Eigen::Vector2d> centre_deviations;
};

// Minimises reprojection errors over the registered poses, the points and the lenses' focal length,
// k1 and, where free, principal point (Triggs et al. 2000): Levenberg-Marquardt in double; points
// are eliminated, the cameras solved by a dense Cholesky decomposition. Each photograph's rows of
// the reduced matrix are summed by one task in the order of its observations, so the result does
// not depend on the number of threads.
BundleSummary AdjustBundle(std::span<const MapperPhotograph> photographs,
                           const BundleOptions& options, ThreadPool& pool, GlobalModel& model);

}  // namespace pepeseg
