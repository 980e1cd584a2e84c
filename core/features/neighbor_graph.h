#pragma once

#include <cstdint>
#include <vector>

#include "core/scene/gaussians.h"

namespace pepeseg {

// The num_neighbors Gaussians whose means are nearest to each one's, by distance, itself first:
// [count, num_neighbors]. Where there are fewer, the last places hold the Gaussian itself.
// num_neighbors: 1..kMaxNeighbors. Exact; among equal distances which ones are taken is not defined
// but the same in each run. Uses every core of the machine.
std::vector<int32_t> NearestNeighbors(const Gaussians& gaussians, int num_neighbors);

}  // namespace pepeseg
