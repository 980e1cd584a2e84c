#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/scene/gaussians.h"

namespace pepeseg {

// Returns the connected part of each of the `selected` Gaussians (indices into `gaussians`, without
// repeats): 0, 1, ... in the order in which the parts appear in `selected`.
//
// A Gaussian is connected to those of its 16 nearest selected neighbours that it touches. Two
// Gaussians touch if their ellipsoids of 3 standard deviations, to which splats are drawn, together
// reach from one mean to the other along the line between them.
std::vector<int32_t> ConnectedParts(const Gaussians& gaussians, std::span<const int32_t> selected);

}  // namespace pepeseg
