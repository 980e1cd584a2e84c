#pragma once

#include <cstdint>
#include <vector>

#include "core/scene/camera.h"

namespace pepeseg {

// Pixels of a view, y * width + x, on a regular grid of about `max_cells` cells at most.
std::vector<int32_t> GridPixels(const Camera& camera, double max_cells);

}  // namespace pepeseg
