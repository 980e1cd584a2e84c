#pragma once

#include <cstdint>
#include <span>

namespace pepeseg {

// How well two partitions of the same things agree, corrected for chance (Hubert and Arabie 1985):
// 1 for equal ones whatever their ids, about 0 for independent ones, below 0 for worse than those.
// Ids are any numbers. Both in one piece, both all singletons, or fewer than two things: 1.
double AdjustedRand(std::span<const int32_t> a, std::span<const int32_t> b);

}  // namespace pepeseg
