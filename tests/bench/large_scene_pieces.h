#pragma once

#include <cstdint>
#include <vector>

#include "tests/bench/large_scene.h"

namespace pepeseg {

// What a place is made of.
struct PlacePieces {
  std::vector<Material> materials;
  std::vector<Piece> pieces;
  int num_things = 0;
};
PlacePieces MakePlace(Place place, uint64_t seed);

}  // namespace pepeseg
