#pragma once

#include <cstdint>

namespace pepeseg {

// Host memory that SAM takes at most, bytes: 523 MiB were measured with 2 threads.
inline constexpr int64_t kSamHostBytes = int64_t{560} << 20;

// Seconds of a core (x86-64 with AVX-512) that the masks of a photograph take with the default
// AutomaticMaskOptions, whatever its size: tests/bench/results/sam_masks.md.
inline constexpr double kSamCoreSeconds = 12;

}  // namespace pepeseg
