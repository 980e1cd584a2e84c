#pragma once

#include <algorithm>

#include "kernels/cpu/simd_kernels.h"
#include "kernels/math/blend.h"
#include "kernels/render_scratch.h"

namespace pepeseg {

// Number of tiles of the last render.
inline int NumTilesOf(const RenderScratch& scratch) {
  return scratch.num_tiles_x * scratch.num_tiles_y;
}

// Returns one tile of the last render; it points into the scratch.
inline TileSplats TileAt(const RenderScratch& scratch, int64_t tile) {
  const int x = static_cast<int>(tile % scratch.num_tiles_x) * kTileSize;
  const int y = static_cast<int>(tile / scratch.num_tiles_x) * kTileSize;
  const int32_t first = scratch.tile_first_entry.span()[tile];
  return {scratch.visible_splat.span().data,
          scratch.entry_visible.span().data + first,
          scratch.entry_slot.span().data + first,
          first,
          scratch.tile_first_entry.span()[tile + 1] - first,
          static_cast<float>(x),
          static_cast<float>(y),
          std::min(kTileSize, scratch.width - x),
          std::min(kTileSize, scratch.height - y)};
}

// Calls fn(index in the image, index in the tile) for the tile's pixels inside the image.
template <class Fn>
inline void ForEachTilePixel(const TileSplats& tile, int image_width, Fn&& fn) {
  const int64_t corner = static_cast<int64_t>(tile.y) * image_width + static_cast<int64_t>(tile.x);
  for (int y = 0; y < tile.height; ++y) {
    for (int x = 0; x < tile.width; ++x) {
      fn(corner + int64_t{y} * image_width + x, TilePixel(x, y));
    }
  }
}

}  // namespace pepeseg
