#pragma once

#include "tests/testing/crowded_surfaces.h"

namespace pepeseg::testing {

inline constexpr int kNumBolts = 20;

// A panel with 20 equal bolts, turned differently and unevenly spread, and things that are not
// bolts: 6 knobs, which are larger and blue, 6 square yellow pads, and 4 bolt heads without a
// washer. The parts of a bolt are its washer and its head. On a table in front of a screen, about 3
// wide and 1.6 high.
CrowdedSurfaces MakeBoltSurfaces();

}  // namespace pepeseg::testing
