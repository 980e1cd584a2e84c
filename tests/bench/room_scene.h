#pragma once

#include <cstdint>
#include <vector>

#include "kernels/ops/render.h"

namespace pepeseg {

// A stand-in for a trained scene: flat Gaussians on the walls and on the boxes and balls of a room,
// about as large as the distance to their neighbours, most of them opaque.
struct RoomScene {
  int64_t count = 0;
  std::vector<float> planes;  // [NumPlanes(3), count]
};
RoomScene MakeRoomScene(int64_t count, uint64_t seed);

// Inside the room, view `index` of `count` on a circle, looking across the middle.
PinholeView RoomView(int index, int count, int width, int height);

}  // namespace pepeseg
