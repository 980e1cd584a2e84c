#pragma once

#include <vector>

#include "core/priors/sam/prompted_segmenter.h"
#include "core/scene/capture.h"

namespace pepeseg {

// The points of a grid of `points_per_side` x `points_per_side` over a photograph. Neighbours are
// far apart in the order, so that an early answer can settle a later point.
std::vector<PromptPoint> GridPoints(const Image& photo, int points_per_side);

// The deepest point of each mask, found on a coarser image of it.
std::vector<PromptPoint> RegionPoints(const MaskSet& masks);

}  // namespace pepeseg
