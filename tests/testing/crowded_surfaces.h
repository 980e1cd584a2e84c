#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tests/testing/ray_scene.h"

namespace pepeseg::testing {

// Many small parts that touch and often look alike: a wall of stacked blocks, a figure with limbs
// and a row of thin books, on a table in front of a folding screen. About 3 wide and 1.6 high.
struct CrowdedSurfaces {
  std::vector<Surface> surfaces;          // labelled by part; 0: table and screen
  std::vector<std::string> part_names;    // by part; empty for 0
  std::vector<std::string> object_names;  // by object; empty for 0
  std::vector<uint16_t> object_of_part;   // 0 for part 0
};
CrowdedSurfaces MakeCrowdedSurfaces();

}  // namespace pepeseg::testing
