#pragma once

#include <cstdint>
#include <vector>

#include "kernels/ops/render.h"

namespace pepeseg {

// A synthetic substitute for a trained scene: flat Gaussians on the walls, boxes and balls of a
// room, about as large as the distance to their neighbours, most of them opaque.
struct RoomScene {
  int64_t count = 0;
  std::vector<float> planes;  // [NumPlanes(3), count]
};
RoomScene MakeRoomScene(int64_t count, uint64_t seed);

// Returns view `index` of `count` inside the room, on a circle, looking across the centre.
PinholeView RoomView(int index, int count, int width, int height);

}  // namespace pepeseg
