#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/scene/gaussians.h"

namespace pepeseg {

// The part of each of some Gaussians, where a part is what hangs together: 0, 1, ... in the order
// of the rows in which they are first met. A Gaussian is joined to those of its 16 nearest
// neighbours among the rows that it touches: the ellipsoids of 3 standard deviations, to where
// splats are drawn, reach as far along the line between the two means as these are apart.
std::vector<int32_t> ConnectedParts(const Gaussians& gaussians, std::span<const int32_t> rows);

}  // namespace pepeseg
