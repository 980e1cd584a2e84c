#pragma once

#include "kernels/math/hd.h"
#include "kernels/ops/network.h"

namespace pepeseg {

// Returns the place, over all images, of a token of a window grid, or -1 for padding.
PEPESEG_HD int PlaceOfToken(const WindowGrid& grid, int token) {
  const int tokens = grid.side * grid.side;
  const int window = token / tokens, within = token - window * tokens;
  const int across = (grid.width + grid.side - 1) / grid.side;
  const int down = (grid.height + grid.side - 1) / grid.side;
  const int row = window / across;  // of windows, over all images
  const int image = row / down;
  const int y = (row - image * down) * grid.side + within / grid.side;
  const int x = (window - row * across) * grid.side + within % grid.side;
  if (y >= grid.height || x >= grid.width) return -1;
  return (image * grid.height + y) * grid.width + x;
}

}  // namespace pepeseg
