#pragma once

#include <cstdint>
#include <vector>

#include "core/scene/gaussians.h"

namespace pepeseg {

// Returns the num_neighbors Gaussians whose means are nearest to that of each Gaussian, itself
// first, then by distance: [count, num_neighbors], for NeighborGraph (METHOD.md section 3,
// "Smoothing"). If there are fewer Gaussians, the last columns hold the Gaussian itself.
// num_neighbors: 1..kMaxNeighbors.
//
// The search is exact. Which of several Gaussians at equal distance is taken is unspecified, but
// the same in each run. Uses all cores of the machine.
std::vector<int32_t> NearestNeighbors(const Gaussians& gaussians, int num_neighbors);

}  // namespace pepeseg
