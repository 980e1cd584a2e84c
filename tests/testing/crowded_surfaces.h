#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tests/testing/ray_scene.h"

namespace pepeseg::testing {

// Many small parts that touch and often look alike: a wall of stacked blocks, a figure with limbs
// and a row of thin books, on a table before a folding screen. About 3 wide and 1.6 high.
struct CrowdedSurfaces {
  std::vector<Surface> surfaces;          // labelled by part; table and screen: 0
  std::vector<std::string> part_names;    // by part; of 0: empty
  std::vector<std::string> object_names;  // by object; of 0: empty
  std::vector<uint16_t> object_of_part;   // of 0: 0
};
CrowdedSurfaces MakeCrowdedSurfaces();

}  // namespace pepeseg::testing
