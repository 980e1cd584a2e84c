#pragma once

#include <algorithm>
#include <cstdint>

namespace pepeseg {

// Photographs that are segmented at the same time on `num_threads` threads: one thread each takes
// less processor time than several that share one, but each takes memory.
constexpr int SamPhotographsAtOnce(int num_threads) { return std::clamp(num_threads, 1, 4); }

// Host memory that SAM takes at most on `num_threads` threads, bytes: 591, 1006 and 1870 MiB were
// measured for 1, 2 and 4 photographs at a time.
constexpr int64_t SamHostBytes(int num_threads) {
  return (int64_t{200} << 20) + (int64_t{430} << 20) * SamPhotographsAtOnce(num_threads);
}

// Seconds of a core (x86-64 with AVX-512) that the masks of a photograph take with the default
// AutomaticMaskOptions, whatever its size: tests/bench/results/sam_masks.md.
inline constexpr double kSamCoreSeconds = 12;

}  // namespace pepeseg
