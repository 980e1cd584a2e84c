#pragma once

#include <algorithm>
#include <cmath>

#include "kernels/math/blend.h"
#include "kernels/render_scratch.h"

namespace pepeseg {

struct TileGrid {
  int num_x;
  int num_y;
};

// Calls fn(run) for the tiles that hold a pixel centre in reach of the
// splat, row by row: exact for the ellipse against the rectangle of a tile's pixel centres, as the
// part of an ellipse within a band of rows is convex.
template <class Fn>
inline void ForEachTileRun(const Splat& splat, const TileGrid& grid, Fn&& fn) {
  constexpr float kFirst = 0.5f, kLast = kTileSize - 0.5f, kInvSize = 1.0f / kTileSize;
  const float half_height = splat.half_height;
  const float shear = -splat.root_xy / splat.root_xx;
  // Half the width of the ellipse at its mean's row, and the row offset of its rightmost point.
  const float waist = half_height * splat.root_yy / splat.root_xx;
  const float rightmost = -half_height * splat.root_xy /
                          std::sqrt(splat.root_xy * splat.root_xy + splat.root_yy * splat.root_yy);
  const float inv_height2 = 1 / (half_height * half_height);
  // In floats and clamped before the conversion: a splat may reach far beyond any int.
  const auto clamp_to = [](float v, int end) {
    return static_cast<int>(std::clamp(v, 0.0f, static_cast<float>(end)));
  };
  const int first_y = clamp_to(std::ceil((splat.y - half_height - kLast) * kInvSize), grid.num_y);
  const int end_y =
      clamp_to(std::floor((splat.y + half_height - kFirst) * kInvSize) + 1, grid.num_y);
  for (int tile_y = first_y; tile_y < end_y; ++tile_y) {
    const float top = std::max(tile_y * kTileSize + kFirst - splat.y, -half_height);
    const float bottom = std::min(tile_y * kTileSize + kLast - splat.y, half_height);
    const float right_dy = std::clamp(rightmost, top, std::max(top, bottom));
    const float left_dy = std::clamp(-rightmost, top, std::max(top, bottom));
    const auto half_at = [&](float dy) {
      return waist * std::sqrt(std::max(0.0f, 1 - dy * dy * inv_height2));
    };
    const float right = splat.x + shear * right_dy + half_at(right_dy);
    const float left = splat.x + shear * left_dy - half_at(left_dy);
    const int first_x = clamp_to(std::ceil((left - kLast) * kInvSize), grid.num_x);
    const int end_x = clamp_to(std::floor((right - kFirst) * kInvSize) + 1, grid.num_x);
    if (first_x < end_x) fn(TileRun{tile_y * grid.num_x + first_x, end_x - first_x});
  }
}

}  // namespace pepeseg
