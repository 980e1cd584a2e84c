#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace pepeseg {

// Of each pixel, over how many of the thresholds it is, at most 255.
std::vector<uint8_t> LevelsOf(std::span<const float> similarity, std::span<const float> thresholds);

}  // namespace pepeseg
