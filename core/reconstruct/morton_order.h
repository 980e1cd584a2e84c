#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace pepeseg {

// The order of points along the Morton curve of their bounding box, 21 bits an axis; equal codes by
// index. means: [3, count], planes x, y, z.
std::vector<int64_t> MortonOrder(std::span<const float> means);

}  // namespace pepeseg
